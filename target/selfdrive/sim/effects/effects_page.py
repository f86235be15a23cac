"""Writes the reference page of image effects: pictures with detected lanes, and measured severity.

`python -m selfdrive.sim.effects.effects_page [--out docs/reference]` writes image-effects.md and the
folder image-effects with a picture for each effect.
"""

import argparse
import csv
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.effects import PaperFog, PaperOcclusion, PaperRain, PaperSnow, weather_of_levels
from selfdrive.sim.effects.degradation import Degradation, DegradationGauge
from selfdrive.sim.effects.effect import Effect, Moment
from selfdrive.sim.effects.levels import AUTHORS_CODE_AMOUNTS, PAPER_AMOUNTS, PHYSICAL_AMOUNTS
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond.authors_code_detector import AuthorsCodeDetector
from selfdrive.visiond.detector import LaneDetector, LaneLines
from selfdrive.visiond.paper_detector import PaperDetector
from selfdrive.visiond.robust_detector import RobustDetector

SEEDS = 1, 2, 3, 4, 5  # several, because one drawing of an effect can be mild by chance
PICTURES_PER_SEED = 6  # per seed
PICTURE_STEP, CAR_SPEED = 0.05, 26.82  # s, m/s
DETECTOR_STYLES: dict[str, tuple[type, tuple[int, int, int], int]] = {  # with colour (BGR) and width (px)
    "paper": (PaperDetector, (60, 60, 255), 7),
    "robust": (RobustDetector, (255, 200, 0), 2),
    "as_coded": (AuthorsCodeDetector, (80, 220, 80), 1),
}
CHECK_DISTANCE, MOST_LINE_ERROR = 10.0, 0.3  # m: a line is found if it is at most this far off
PANEL_SIZE, TITLE_HEIGHT = (320, 240), 20  # px
COVERAGE_GREY = 100  # grey level of the picture in which coverage is measured
# in the folder of pictures; counted by `visiond_lab.evaluate_under_effects`
REAL_FRAMES_CSV = "real-frames.csv"
PAGE_TEXT = """\
# Image effects

This page shows the weather, dirt and light that a fault can put between the road and the camera. The fault
model [image_effect](fault-models.md#image_effect) applies an effect. This page is written by
`python -m selfdrive.sim.effects.effects_page`.

An effect has an amount, a seed and a camera model. These and the moment (time, distance driven, speed)
determine how it changes a picture, so pictures can be computed in any order. Drops and flakes fall and come
nearer from picture to picture; dirt stays on the lens. The same seed gives the same bytes. The effects treat
grey levels as proportional to light, so that the laws of optics apply to them directly.

The pictures show levels 1, 5 and 10 or, if there are fewer levels, the mildest, a middle one and the
strongest. Lines show what the detectors find: **broad red** for `paper`, **narrow blue** for `robust`,
**thin green** for `as_coded`. The tables give means over {seeds} seeds with {pictures} pictures each
(20 a second, at 60 mph, in the middle of a rendered lane with solid lines, with the default camera):

* PSNR: similarity to the clean picture; a higher value means a smaller difference.
* Mark contrast: difference in grey levels between the lane's lines and the road beside them, 5 to 30 m ahead.
  Clean pictures have {clean.mark_contrast:.0f}.
* False edges: share of the lane's inside, away from its lines, where the horizontal gradient (Sobel) is at
  least that of a step of 8 grey levels, and at least half that of a mark's edge at the remaining contrast.
  Clean pictures have {clean.false_edges:.1%}.
* Covered: share of the lane's inside, 5 to 30 m ahead, where drops, flakes, blobs or blotches change an even
  grey by at least 8 levels.
* Found: share of pictures in which a detector finds both lines, each within 0.3 m of the truth 10 m ahead,
  including lines from which it abstains (probability below 0.5). If `as_coded` finds nothing, it repeats its
  last result, which happens to be correct here. Its high shares at the strongest levels therefore mean that
  it sees nothing.
* Missed on real frames: number of pictures in which a detector misses a line. The six frames show highways
  (from Udacity's first project on lane finding, MIT licence). Random effects are applied with 20 seeds. The
  detectors have no memory of earlier pictures. The counts are not independent, because they come from only
  six roads. The repository contains [the counts](image-effects/real-frames.csv), but not the frames. For your
  own frames, `python -m selfdrive.visiond_lab.evaluate_under_effects FRAMES TRUTH` counts the misses and,
  with `--strips`, shows all levels. No real frame was used in training or tuning: on rendered roads, `paper`
  was trained behind all effects, and `robust` was tuned for rain and snow.

## What a level of the paper's effects represents

The paper's text gives numbers of streaks, blocks and blobs, and contrasts, but not how bad the weather is.
The weather of each level is derived from these numbers. Parameters that the text leaves open (the length of
streaks, the number of blocks) were chosen to match this weather. Only the position of blobs differs from the
text:

* Rain: a streak is a drop of at least 1 mm within 2.2 m of the camera. The rain rate follows from the number
  of drops in this part of the view (Marshall and Palmer, 1948). A streak is as long as the distance that such
  a drop falls (6 m/s; Atlas and others, 1973) during an exposure of 4 ms.
* Snow: a block of two pixels is a flake that looks at least as large (Gunn and Marshall, 1958; density after
  Holroyd, 1971).
* Two numbers are our own choice: the 2.2 m, and 100 blocks for each level. We chose them once, before tuning
  any detector, so that levels 1 to 10 range from light to violent rain (50 mm/h and more) and from light to
  heavy snow (a range below 400 m).
* Fog: the text's contrast is the one that remains 17.5 m ahead, in the middle of the measured road
  (Koschmieder, 1924).
* Range: the meteorological range, at which 5 % of the contrast remains. In rain and snow, it follows from
  their extinction (Halder and others, 2019; ITU-R P.1814). The text's contrasts of rain and snow are lower.
* Occlusion: in the text, blobs can be anywhere in the picture. Here they lie below the horizon, because dirt
  on the sky hides nothing important. Up to four blobs mostly miss the lane. With five or more, a level
  represents the share of the lane's inside that is covered, as the table shows.

{stands_for}
"""
PRESETS = (
    (
        "The paper's effects",
        PAPER_AMOUNTS,
        "These effects have the paper's parameters. An amount is a level, a gain, a bias or a kernel.",
    ),
    (
        "The paper's effects as coded",
        AUTHORS_CODE_AMOUNTS,
        "These effects follow the code of the paper's authors and are redrawn in every picture. Contrast, "
        "brightness and blur are the same as above.",
    ),
    (
        "Physical effects",
        PHYSICAL_AMOUNTS,
        "These effects have physical units and follow published laws, which the modules cite.",
    ),
)


class LevelRow(NamedTuple):
    amount: float
    degradation: Degradation
    covered_share: float
    shares_with_both_lines: tuple[float, ...]  # share of pictures, per detector
    picture: np.ndarray  # the last one, in colour, with lines


class EffectStudio:
    def __init__(self) -> None:
        self.model = CameraModel()
        renderer = RoadRenderer(self.model, "solid", SEEDS[0])
        self._moments = [
            Moment(2.0 + PICTURE_STEP * k, 50.0 + PICTURE_STEP * CAR_SPEED * k, CAR_SPEED)
            for k in range(PICTURES_PER_SEED)
        ]
        self._clean_pictures = [renderer.render_grey(moment.position) for moment in self._moments]
        self._gauge = DegradationGauge(self.model, renderer.true_lines())
        self._truth = renderer.true_lines()

    def measure_clean(self) -> Degradation:
        return _mean_degradation([self._gauge.measure(clean, clean) for clean in self._clean_pictures])

    def measure_level(self, kind: type[Effect], amount: float) -> LevelRow:
        measures: list[Degradation] = []
        lines_found: list[list[bool]] = []
        picture, covered_shares = np.empty(0), []
        grey = np.full_like(self._clean_pictures[0], COVERAGE_GREY)
        for seed in reversed(SEEDS):  # the first seed's picture is shown
            effect = kind(amount, seed, self.model)
            affected = [effect.apply(*pair) for pair in zip(self._clean_pictures, self._moments, strict=True)]
            measures += [
                self._gauge.measure(*pair) for pair in zip(self._clean_pictures, affected, strict=True)
            ]
            covered_shares.append(self._gauge.covered_share(effect.apply(grey, self._moments[-1])))
            picture = cv2.cvtColor(affected[-1], cv2.COLOR_GRAY2BGR)
            lines = [
                list(_detect_all(detector(self.model), affected))
                for detector, _, _ in DETECTOR_STYLES.values()
            ]
            lines_found += [
                [self._has_found_both(each) for each in pair] for pair in zip(*lines, strict=True)
            ]
            for each, (_, colour, width) in zip(lines, DETECTOR_STYLES.values(), strict=True):
                draw_lines(picture, self.model, each[-1], colour, width)
        share = float(np.mean(covered_shares))
        return LevelRow(
            amount, _mean_degradation(measures), share, tuple(np.mean(lines_found, axis=0)), picture
        )

    def _has_found_both(self, lines: LaneLines) -> bool:
        return all(
            line.prob > 0.0
            and abs(line.y + line.slope * CHECK_DISTANCE - y - slope * CHECK_DISTANCE) <= MOST_LINE_ERROR
            for line, (y, slope) in zip((lines.left, lines.right), self._truth, strict=True)
        )


def _detect_all(detector: LaneDetector, pictures: list[np.ndarray]) -> Iterator[LaneLines]:
    for picture in pictures:
        yield detector.detect(CameraView(0.0, 0.0, 0.0, (), 0.0, picture))


def _mean_degradation(measures: list[Degradation]) -> Degradation:
    return Degradation(*np.mean(measures, axis=0))


def draw_lines(
    picture: np.ndarray, model: CameraModel, lines: LaneLines, colour: tuple[int, int, int], width: int
) -> None:
    """Draw the detected lines, from 4 to 40 m ahead, into a BGR picture."""
    for line in (lines.left, lines.right):
        if line.prob > 0.0:
            ends = [(x, line.y + line.slope * x) for x in (4.0, 40.0)]
            start, end = ((round(model.column(x, y)), round(model.row(x))) for x, y in ends)
            cv2.line(picture, start, end, colour, width, cv2.LINE_AA)


def draw_strip(rows: list[LevelRow], unit: str) -> np.ndarray:
    level_indices = sorted({0, (len(rows) - 1) // 2, len(rows) - 1})
    return np.hstack([draw_level_panel(rows[k].picture, k + 1, rows[k].amount, unit) for k in level_indices])


def draw_level_panel(picture: np.ndarray, level: int, amount: float, unit: str) -> np.ndarray:
    small = cv2.resize(picture, PANEL_SIZE, interpolation=cv2.INTER_AREA)
    title = np.zeros((TITLE_HEIGHT, *small.shape[1:]), dtype=np.uint8)
    text, white = f"level {level}: {amount:g} {unit}", (255, 255, 255)
    cv2.putText(title, text, (6, 14), cv2.FONT_HERSHEY_SIMPLEX, 0.42, white, 1, cv2.LINE_AA)
    return np.vstack([title, small])


def level_table(rows: list[LevelRow], unit: str, real: list[dict[str, str]]) -> str:
    """The levels' measurements as Markdown; `real` are their rows of the table of real frames, if any."""
    names = ["covered", *(f"found by `{name}`" for name in DETECTOR_STYLES)]
    missed = [head for head in (real[0] if real else ()) if head.startswith("missed_")]
    names += [f"missed on real frames by `{head.removeprefix('missed_')}`" for head in missed]
    lines = [
        f"| level | amount ({unit}) | PSNR (dB) | mark contrast | false edges | {' | '.join(names)} |",
        "|---|---|---|---|---|" + "---|" * len(names),
    ]
    for level, row in enumerate(rows, 1):
        psnr, contrast, false_edges = row.degradation
        cells = [f"{level}", f"{row.amount:g}", f"{psnr:.1f}", f"{contrast:.0f}", f"{false_edges:.1%}"]
        cells += [f"{row.covered_share:.0%}", *(f"{share:.0%}" for share in row.shares_with_both_lines)]
        if real:
            counted = real[level - 1]
            cells += [f"{counted[head]} of {counted['pictures']}" for head in missed]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def weather_table(measured: dict[type[Effect], list[LevelRow]], model: CameraModel) -> str:
    heads = ("rain (mm/h)", "range (m)", "road covered", "fog: contrast left", "range (m)")
    heads += ("snow (mm/h)", "range (m)", "road covered", "occlusion: road covered")
    lines = [f"| level | {' | '.join(heads)} |", "|---|" + "---|" * len(heads)]
    for level in range(1, 11):
        rain, snow = (
            weather_of_levels.rain_of_level(level, model),
            weather_of_levels.snow_of_level(level, model),
        )
        contrast = PaperFog(level, 0, model).contrast
        effects_with_coverage = (PaperRain, PaperSnow, PaperOcclusion)
        covered = {kind: f"{measured[kind][level - 1].covered_share:.0%}" for kind in effects_with_coverage}
        cells = [f"{rain.rate:.0f}", f"{rain.visible_range:.0f}", covered[PaperRain]]
        cells += [f"{contrast:.2f}", f"{weather_of_levels.fog_of_contrast(contrast).visible_range:.0f}"]
        cells += [
            f"{snow.rate:.1f}",
            f"{snow.visible_range:.0f}",
            covered[PaperSnow],
            covered[PaperOcclusion],
        ]
        lines.append(f"| {level} | {' | '.join(cells)} |")
    return "\n".join(lines)


def write_page(out: Path) -> None:
    studio = EffectStudio()
    folder = out / "image-effects"
    folder.mkdir(parents=True, exist_ok=True)
    measured: dict[type[Effect], list[LevelRow]] = {}
    parts = []
    for title, levels, about in PRESETS:
        parts.append(f"## {title}\n\n{about}\n")
        for kind, amounts in levels.items():
            rows = measured[kind] = [studio.measure_level(kind, amount) for amount in amounts]
            file = folder / f"{kind.__name__}.jpg"
            cv2.imwrite(str(file), draw_strip(rows, kind.UNIT), [cv2.IMWRITE_JPEG_QUALITY, 80])
            about = " ".join((kind.__doc__ or "").split())
            limits = f"{kind.LEAST:g} to {kind.MOST:g}"
            parts.append(
                f"### {kind.__name__}\n\n{about} Amount: {limits} ({kind.UNIT}).\n\n"
                f"![{kind.__name__} at three levels](image-effects/{file.name})\n\n"
                f"{level_table(rows, kind.UNIT, _real_frame_rows(folder, kind))}\n"
            )
    text = PAGE_TEXT.format(
        clean=studio.measure_clean(),
        seeds=len(SEEDS),
        pictures=PICTURES_PER_SEED,
        stands_for=weather_table(measured, studio.model),
    )
    (out / "image-effects.md").write_text("\n".join([text, *parts]), encoding="utf-8")


def _real_frame_rows(folder: Path, kind: type[Effect]) -> list[dict[str, str]]:
    path = folder / REAL_FRAMES_CSV
    if not path.exists():
        return []
    with path.open(encoding="utf-8") as file:
        return [line for line in csv.DictReader(file) if line["effect"] == kind.__name__]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("docs/reference"), help="folder of reference pages")
    cv2.setNumThreads(1)
    write_page(parser.parse_args().out)


if __name__ == "__main__":
    main()
