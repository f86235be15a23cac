"""Rain and snow of a given rate, in mm of water per hour: single drops near the camera, a veil beyond.

Drops and flakes scatter the sky's light from all directions into the camera (K. Garg and S. Nayar, 2007), so
they are visible against the road but not against the sky.
"""

from abc import abstractmethod
from math import exp, log

import numpy as np

from selfdrive.common.array_math import each
from selfdrive.sim.effects.air import airlight, transmitted_share
from selfdrive.sim.effects.compiled_gaussian import build_gaussian
from selfdrive.sim.effects.compiled_precipitation import build_precipitation_parts
from selfdrive.sim.effects.effect import Effect, Scene
from selfdrive.sim.effects.particles import AirBox
from selfdrive.sim.effects.windscreen import VIEW_BLUR, Windscreen
from selfdrive.sim.picture import Picture, Region, whole

EXPOSURE_TIME = 0.001  # s, under a grey sky
GLASS_DROP_SIZES = 1000  # number of diameters to choose from


class _Precipitation(Effect):
    """Particles whose numbers decrease exponentially with their (melted) diameter.

    `VISIBLE_REACHES` pairs a least diameter (mm) with the distance (m) up to which such particles are visible
    and drawn individually. In dense air only the nearest `MOST_IN_BOX` are drawn, a third of them in view.
    """

    UNIT = "mm/h"
    VISIBLE_REACHES: tuple[tuple[float, float], ...]
    MOST_IN_BOX: int

    def _build(self) -> str:
        self._parts, by = build_precipitation_parts(self.camera)
        return by

    def _prepare(self, random: np.random.Generator) -> None:
        self._cover = self._parts.cover(self.camera)
        limits = [least for least, _ in self.VISIBLE_REACHES] + [self.largest_diameter()]
        boxes = [
            self._fill_box(random, least, most, reach)
            for (least, reach), most in zip(self.VISIBLE_REACHES, limits[1:], strict=True)
        ]
        self._particles = self._parts.particles(random, self.camera, boxes)
        self._veil = np.rint(255.0 * transmitted_share(self.extinction_coefficient(), self.camera)).astype(
            np.uint8
        )

    def _fill_box(self, random: np.random.Generator, least: float, most: float, reach: float) -> AirBox:
        density = self.particle_density(least, most)
        across = self.camera.width / self.camera.fx * self.camera.rows / self.camera.fy
        reach = min(reach, (self.MOST_IN_BOX / (density * across)) ** (1.0 / 3.0))
        melted = self._draw_diameters(random, least, most, round(density * across * reach**3))
        return AirBox(reach, *self.sizes_and_speeds(melted))

    def particle_density(self, least: float, most: float) -> float:
        """Particles per m^3 with diameters (mm) from `least` to `most`."""
        number, slope = self._size_spectrum()
        return number / slope * (exp(-slope * least) - exp(-slope * most))

    def _draw_diameters(
        self, random: np.random.Generator, least: float, most: float, count: int
    ) -> np.ndarray:
        _, slope = self._size_spectrum()
        few, many = exp(-slope * most), exp(-slope * least)
        return -each(log, few + (many - few) * random.uniform(size=count)) / slope

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        particle_shares = self._cover.covered_shares(self._particles.streaks(scene, EXPOSURE_TIME), region)
        air = airlight(picture, self.camera)
        return self._parts.veil_picture(picture[region.part], self._veil[region.part], particle_shares, air)

    @abstractmethod
    def _size_spectrum(self) -> tuple[float, float]:
        """N0 (per m^3 and mm) and slope (1/mm) of N0 * exp(-slope * diameter)."""

    @abstractmethod
    def largest_diameter(self) -> float:
        """Largest diameter (mm)."""

    @abstractmethod
    def sizes_and_speeds(self, melted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Visible diameters (m) and fall speeds (m/s) for melted diameters (mm)."""

    @abstractmethod
    def extinction_coefficient(self) -> float:
        """Extinction coefficient (1/m) of the air with its particles."""


class Rain(_Precipitation):
    """Rain in the air, and drops on the windscreen, which is wiped once a second.

    Drops after Marshall and Palmer (1948), fall speeds after Atlas and others (1973).
    """

    LEAST, MOST = 0.5, 200.0
    VISIBLE_REACHES = (1.0, 1.2), (2.0, 2.0), (3.0, 3.0)
    MOST_IN_BOX = 900

    def _build(self) -> str:
        self._blur = build_gaussian(VIEW_BLUR)
        return super()._build() + self._blur.calculated_by

    def _prepare(self, random: np.random.Generator) -> None:
        limits = self.VISIBLE_REACHES[0][0], self.largest_diameter()
        diameters = 0.001 * self._draw_diameters(random, *limits, GLASS_DROP_SIZES)
        of = self.camera, self.particle_density(*limits), diameters
        self._windscreen = Windscreen(random, *of, self._parts.shrink, self._blur)
        super()._prepare(random)

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        everything = whole(picture.shape)  # each drop shows most of the picture
        through = super()._affect(picture[everything.part], everything, scene)
        return self._windscreen.look_through(through, region, scene)

    def _size_spectrum(self) -> tuple[float, float]:
        return 8000.0, 4.1 * self.amount**-0.21

    def largest_diameter(self) -> float:
        return 6.0  # mm: larger ones break up

    def sizes_and_speeds(self, melted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0.001 * melted, 9.65 - 10.3 * each(exp, -0.6 * melted)

    def extinction_coefficient(self) -> float:
        # Attenuation of light by rain, as used by Halder and others (2019) for rendering.
        return 0.312e-3 * self.amount**0.67


class Snow(_Precipitation):
    """Dry snow: flakes after Gunn and Marshall (1958), fall speeds after Langleben (1954).

    A flake's visible size follows from its mass and a density that falls with its size, 0.17 g/cm^3 at 1 mm
    (Holroyd, 1971).
    """

    LEAST, MOST = 0.1, 10.0
    VISIBLE_REACHES = (1.0, 2.0), (2.0, 6.0), (3.0, 10.0)
    MOST_IN_BOX = 2100

    def _size_spectrum(self) -> tuple[float, float]:
        return 3800.0 * self.amount**-0.87, 2.55 * self.amount**-0.48

    def largest_diameter(self) -> float:
        return 5.0  # mm of water

    def sizes_and_speeds(self, melted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0.001 * melted * np.sqrt(melted / 0.17), 1.6 * each(_to_the_0_3, 0.1 * melted)

    def extinction_coefficient(self) -> float:
        # Attenuation of light by dry snow, 5.5 dB/km at 1 mm/h (ITU-R P.1814).
        return 5.5e-3 * self.amount**1.38 * log(10.0) / 10.0


def _to_the_0_3(value: float) -> float:
    return value**0.3
