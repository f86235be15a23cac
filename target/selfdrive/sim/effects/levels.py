"""Amounts of levels 1 to 10 of each effect, from mild to strong, for pages and benchmarks."""

from selfdrive.sim import effects
from selfdrive.sim.effects.effect import Effect

TEN_LEVELS = 1, 2, 3, 4, 5, 6, 7, 8, 9, 10
PAPER_AMOUNTS: dict[type[Effect], tuple[float, ...]] = {
    effects.PaperRain: TEN_LEVELS,
    effects.PaperFog: TEN_LEVELS,
    effects.PaperSnow: TEN_LEVELS,
    effects.PaperOcclusion: TEN_LEVELS,
    effects.Contrast: (1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.4, 2.6, 2.8, 3.0),
    effects.Brightness: (10, 20, 30, 40, 50, 60, 70, 80, 90, 100),
    effects.AveragingBlur: (3, 4, 5, 6),
    effects.GaussianBlur: (3, 5, 7),
    effects.MedianBlur: (3, 5),
}
AUTHORS_CODE_AMOUNTS: dict[type[Effect], tuple[float, ...]] = {
    effects.CodedRain: TEN_LEVELS,
    effects.CodedFog: TEN_LEVELS,
    effects.CodedSnow: TEN_LEVELS,
    effects.CodedOcclusion: TEN_LEVELS,
}
PHYSICAL_AMOUNTS: dict[type[Effect], tuple[float, ...]] = {
    effects.Fog: (1000, 500, 300, 200, 150, 100, 75, 50, 35, 25),
    effects.Rain: (2, 5, 10, 20, 30, 50, 75, 100, 150, 200),
    effects.Snow: (0.5, 1, 1.5, 2, 3, 4, 5, 6, 8, 10),
    effects.LensMud: (0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6),
    effects.SunGlare: (0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1, 1.5, 2, 3),
    effects.LowLight: (1000, 300, 100, 50, 20, 10, 5, 3, 2, 1),
}
AMOUNTS_BY_EFFECT = PAPER_AMOUNTS | AUTHORS_CODE_AMOUNTS | PHYSICAL_AMOUNTS
