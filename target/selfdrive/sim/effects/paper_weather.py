"""Rain, fog and snow as in the paper, by `thickness` from 1 to 10.

Numbers are from the paper's table of effects and its text. Where the paper gives a range, thickness 1 is the
mild end and 10 the strong end. What the paper leaves open follows from `weather_of_levels`. Streaks and
flakes lie in layers; in farther layers, they are shorter and slower. They fall across the picture, faster
when the car drives faster, and wrap around, so their number is constant.
"""

from math import cos, radians, sin

import cv2
import numpy as np

from selfdrive.common.array_math import each
from selfdrive.sim.effects.canvas import Tile, filtered, seamless, splat, strokes
from selfdrive.sim.effects.compiled_gaussian import build_gaussian
from selfdrive.sim.effects.effect import WHITE, Effect, Scene
from selfdrive.sim.picture import Picture, Region

HAZE = 0.9, 0.4  # remaining share of contrast in fog, and behind snow
STREAKS = 1000  # per thickness: 10,000 at thickness 10
# m: largest distance at which a drop makes a streak; with it, levels 1 to 10 are light to violent rain
REACH = 2.2
# For each layer, far to near: share of the drops within reach that are nearer
NEARER = 0.9, 0.7, 0.5, 0.3, 0.1
FALL, EXPOSURE = 6.0, 0.004  # m/s of a drop of 1.6 mm (Atlas and others, 1973); s under a dark sky
STREAK_LEAN = radians(8.0)
RAIN_SPEED = 1.0 / EXPOSURE, 5.0  # streak lengths per second, and per metre driven
BLOCKS = 100  # of snow per thickness; with it, levels 1 to 10 are light to heavy snow
FLAKE_SPEEDS = 1.0, 1.5, 2.0, 3.0, 4.0
SNOW_SPEED = 40.0, 4.0  # px per second, and per metre driven, times the layer's FLAKE_SPEEDS
FOG_SPEED = 6.0, 2.0  # px per second, and per metre driven


class _PaperWeather(Effect):
    UNIT, LEAST, MOST = "thickness", 1.0, 10.0

    def _between(self, mild: float, strong: float) -> float:
        return mild + self.thickness * (strong - mild)

    def _count(self, each: int, layer: int, layers: int) -> int:
        """Number in a layer, for `each` per thickness; the sum over all layers is exact."""
        total = round(each * self.amount)
        return (total - layer + layers - 1) // layers


class PaperRain(_PaperWeather):
    """1,000 streaks per thickness on a background with less contrast and sharpness."""

    def _build(self) -> str:
        self._blur = build_gaussian(self._between(0.5, 1.5))
        return self._blur.calculated_by

    def _prepare(self, random: np.random.Generator) -> None:
        alpha = self._between(0.1, 0.2)
        self._lengths = [
            self.camera.fy * FALL * EXPOSURE / (REACH * share ** (1.0 / 3.0)) for share in NEARER
        ]
        self._tiles = []
        for layer, length in enumerate(self._lengths):
            levels = self._streaks(random, layer, length)
            smeared = smeared_round(levels, motion_kernel(2, 45.0))
            self._tiles.append(Tile(to_levels(alpha * smeared)))

    def _streaks(self, random: np.random.Generator, layer: int, length: float) -> np.ndarray:
        """White streaks in random places. Falling drops wobble, so brightness varies along a streak."""
        rows, columns = self.camera.rows, self.camera.width
        most = STREAKS * int(self.MOST)
        # The same random numbers for any thickness, so that heavier rain has all streaks of lighter rain.
        count = self._count(STREAKS, layer, len(NEARER))
        column, row, phase, wobble = random.uniform(size=(4, most))[:, :count]
        start = np.stack([columns * column, rows * row])
        end = start + length * np.array([[-sin(STREAK_LEAN)], [cos(STREAK_LEAN)]])
        points = int(length) + 1
        share, across, down = strokes(start, end, np.full(count, points))
        phase, wobble = np.repeat(phase, points), np.repeat(wobble, points)
        light = 1.0 + 0.35 * each(sin, 2 * np.pi * (phase + (1.0 + 2.0 * wobble) * share))
        light *= np.sqrt(each(sin, np.pi * share)) * WHITE
        levels = np.zeros((rows, columns), dtype=np.float32)
        splat(levels, across, down, light)
        return levels

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        wet = filtered(picture, region, self._blur.size // 2, self._blur)
        wet = cv2.convertScaleAbs(wet, alpha=self._between(0.75, 0.65))
        lengths = RAIN_SPEED[0] * scene.t + RAIN_SPEED[1] * scene.position
        for tile, length in zip(self._tiles, self._lengths, strict=True):
            way = length * lengths
            streaks = tile.moved(-sin(STREAK_LEAN) * way, cos(STREAK_LEAN) * way, region)
            cv2.add(wet, streaks, dst=wet)
        return wet


class PaperFog(_PaperWeather):
    """Uniform noise, blurred to droplets, on a background with less contrast."""

    @property
    def contrast(self) -> float:
        return self._between(*HAZE)

    def _prepare(self, random: np.random.Generator) -> None:
        self._haze = haze(
            random, self.camera.rows, self.camera.width, self.amount / self.MOST, self.thickness
        )

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        return hazed(picture[region.part], self._haze, self.contrast, scene, region)


class PaperSnow(_PaperWeather):
    """The fog's haze, and in front of it 100 falling white blocks of 2 x 2 pixels per thickness."""

    def _prepare(self, random: np.random.Generator) -> None:
        rows, columns = self.camera.rows, self.camera.width
        self._haze = haze(random, rows, columns, self.amount / self.MOST, self.thickness)
        sigma, kernel = self._between(0.5, 1.5), motion_kernel(5, 75.0)
        self._tiles = []
        for layer in range(len(FLAKE_SPEEDS)):
            smeared = smeared_round(self._blocks(random, layer), kernel)
            self._tiles.append(Tile(to_levels(blurred_round(smeared, sigma))))

    def _blocks(self, random: np.random.Generator, layer: int) -> np.ndarray:
        rows, columns = self.camera.rows, self.camera.width
        most = BLOCKS * int(self.MOST)
        count = self._count(BLOCKS, layer, len(FLAKE_SPEEDS))
        places = random.integers(0, rows * columns, size=most)[:count]
        white = np.zeros(rows * columns, dtype=np.float32)
        white[places] = WHITE
        white = white.reshape(rows, columns)
        return np.maximum.reduce(
            [np.roll(white, (down, right), (0, 1)) for down in (0, 1) for right in (0, 1)]
        )

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        snow = hazed(picture[region.part], self._haze, self._between(*HAZE), scene, region)
        pixels = SNOW_SPEED[0] * scene.t + SNOW_SPEED[1] * scene.position
        for tile, speed in zip(self._tiles, FLAKE_SPEEDS, strict=True):
            way = speed * pixels
            flakes = tile.moved(-cos(radians(75.0)) * way, sin(radians(75.0)) * way, region)
            cv2.add(snow, flakes, dst=snow)
        return snow


def haze(random: np.random.Generator, rows: int, columns: int, density: float, thickness: float) -> Tile:
    """A repeating tile: noise of 0 to 255 in a share `density` of all pixels, blurred by 5 to 7 pixels."""
    there, level = random.uniform(size=(2, rows, columns)).astype(np.float32)
    noise = np.where(there < density, WHITE * level, 0.0).astype(np.float32)
    return Tile(to_levels(blurred_round(noise, 5.0 + 2.0 * thickness)))


def hazed(picture: np.ndarray, droplets: Tile, contrast: float, scene: Scene, region: Region) -> np.ndarray:
    """Reduce the contrast of the picture's region and add the slowly drifting droplets."""
    down = FOG_SPEED[0] * scene.t + FOG_SPEED[1] * scene.position
    return cv2.addWeighted(picture, contrast, droplets.moved(0.3 * down, down, region), 1.0, 0.0)


def blurred_round(levels: np.ndarray, sigma: float) -> np.ndarray:
    return seamless(levels, int(4 * sigma) + 1, lambda wide: cv2.GaussianBlur(wide, (0, 0), sigma))


def smeared_round(levels: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    return seamless(levels, len(kernel), lambda wide: cv2.filter2D(wide, -1, kernel))


def motion_kernel(length: int, degrees: float) -> np.ndarray:
    """Kernel of a motion by `length` pixels, at this angle counter-clockwise from the row."""
    way = np.linspace(-0.5, 0.5, 16 * length) * (length - 1)
    middle = length // 2 + 1
    columns, rows = middle + way * cos(radians(degrees)), middle - way * sin(radians(degrees))
    size = 2 * middle + 1
    kernel = np.zeros((size, size), dtype=np.float32)
    splat(kernel, columns, rows, np.full(way.size, 1.0 / way.size))
    return kernel


def to_levels(levels: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(levels), 0, WHITE).astype(np.uint8)
