"""Rain, fog, snow and occlusion as the paper's authors coded them, which differs from their text.

Every picture is drawn from the seed and its number, so streaks, flakes, droplets and blobs do not move but
jump. Gaussians end at two sigma, MATLAB's default.
"""

from abc import abstractmethod
from math import ceil, cos, radians, sin
from typing import ClassVar

import cv2
import numpy as np

from selfdrive.sim.effects.canvas import filtered
from selfdrive.sim.effects.compiled_gaussian import build_gaussian
from selfdrive.sim.effects.compiled_scattered import build_scattered
from selfdrive.sim.effects.effect import WHITE, Effect, Scene
from selfdrive.sim.effects.gaussian import Gaussian
from selfdrive.sim.effects.paper_weather import motion_kernel
from selfdrive.sim.effects.scattered import Streak
from selfdrive.sim.picture import Picture, Region, whole

PICTURES_PER_SECOND = 20
CANVAS = 2  # multiple of the picture's size, each way, on which streaks are drawn
CROP = 264 / 480  # of the picture's rows: top of the picture in the canvas
STREAKS = 100  # per pass and level
STREAK_GAINS = tuple(0.10 + 0.01 * k for k in range(1, 11))  # one pass each
STREAK_LEVELS = np.array([round(WHITE * gain) for gain in STREAK_GAINS], np.uint8)
STREAK_LENGTH, STREAK_LEAN = 32, radians(15.0)  # px; from the vertical
DROPLETS = 15_000  # pixels per level
DROPLET_BLUR = 7.0  # px
FLAKES = 250  # blocks per layer
FLAKE_REACH = 3  # px by which blurring enlarges a block of two by two
FLAKE = 2 + 2 * FLAKE_REACH  # px
BLOB_RADII = 5, 50  # px
BLOB_BLUR = 7.0  # px
COVERED = 150  # grey level of the blurred mask; below it, the mask hides the road


class _AsCoded(Effect):
    """An effect with levels 1 to 10, drawn anew in every picture."""

    UNIT: ClassVar[str] = "level"
    LEAST, MOST, WHOLE = 1, 10, True

    def _build(self) -> str:
        self._scattered, by = build_scattered()
        return by

    def _prepare(self, random: np.random.Generator) -> None:
        """Prepare nothing."""

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        number = round(PICTURES_PER_SECOND * abs(scene.t))
        stream = [self.seed, number, *type(self).__name__.encode()]
        return self._drawn(picture, region, np.random.Generator(np.random.PCG64(stream)))

    @abstractmethod
    def _drawn(
        self, picture: np.ndarray | Picture, region: Region, random: np.random.Generator
    ) -> np.ndarray:
        """Return the picture's region with the random elements."""

    @property
    def _level(self) -> int:
        return int(self.amount)


class CodedRain(_AsCoded):
    """Ten passes of streaks, each brighter than the one before, on a blurred and darkened picture."""

    def _build(self) -> str:
        self._blur = _gaussian(0.5 + self._level / 10.0)
        return super()._build() + self._blur.calculated_by

    def _prepare(self, random: np.random.Generator) -> None:
        self._streak = _streak()

    def _drawn(
        self, picture: np.ndarray | Picture, region: Region, random: np.random.Generator
    ) -> np.ndarray:
        level, (rows, columns) = self._level, picture.shape
        wet = filtered(picture, region, self._blur.size // 2, self._blur)
        wet = cv2.convertScaleAbs(wet, alpha=0.75 - level / 100.0)
        box = np.array([CANVAS * columns, CANVAS * rows, region.left, round(CROP * rows) + region.top])
        chances = random.random((len(STREAK_GAINS), STREAKS * level, 2), np.float32)
        light = self._scattered.streak_light(chances, self._streak, STREAK_LEVELS, box, region.shape)
        return cv2.add(wet, light, dst=wet)


class _Hazed(_AsCoded):
    """Base of effects with the haze of CodedFog."""

    def _build(self) -> str:
        self._half_blur = _gaussian(DROPLET_BLUR / 2.0)
        return super()._build() + self._half_blur.calculated_by

    def _hazed(
        self, picture: np.ndarray | Picture, region: Region, random: np.random.Generator
    ) -> np.ndarray:
        shape, blur = picture.shape, self._half_blur
        droplets = self._scattered.droplets(random, shape, DROPLETS * self._level)
        wide = _halved(region.around(2 * (blur.size // 2) + 2, shape), shape)
        rows, columns = wide.shape
        half = cv2.resize(droplets[wide.part], (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
        fog = cv2.resize(blur(half), (columns, rows))[region.inside(wide)]
        return cv2.addWeighted(picture[region.part], 0.9 - 0.05 * self._level, fog, 1.0, 0.0)


class CodedFog(_Hazed):
    """White pixels in random places, blurred, added to a picture with reduced contrast."""

    def _drawn(
        self, picture: np.ndarray | Picture, region: Region, random: np.random.Generator
    ) -> np.ndarray:
        return self._hazed(picture, region, random)


class CodedSnow(_Hazed):
    """The haze, plus one layer of flakes per level with increasing blur, smeared."""

    def _prepare(self, random: np.random.Generator) -> None:
        self._smear = motion_kernel(5, 75.0)
        self._flakes = np.stack([_flake(0.5 + number / 10.0) for number in range(1, self.MOST + 1)])

    def _drawn(
        self, picture: np.ndarray | Picture, region: Region, random: np.random.Generator
    ) -> np.ndarray:
        rows, columns = (size + 2 * FLAKE_REACH for size in picture.shape)
        places = random.integers(0, (rows - FLAKE) * columns, (self._level, FLAKES))
        wide = region.around(len(self._smear) // 2, picture.shape)
        # Only flakes that begin in these rows are visible; a flake at a row's end continues in the next row.
        first, end = max(wide.top + FLAKE_REACH - FLAKE, 0), wide.bottom + FLAKE_REACH
        light = self._scattered.flake_light(places, self._flakes[: self._level], columns, first, end)
        down, right = wide.top + FLAKE_REACH - first, wide.left + FLAKE_REACH
        light = light[down : down + wide.shape[0], right : right + wide.shape[1]]
        flakes = cv2.filter2D(cv2.convertScaleAbs(light), -1, self._smear)[region.inside(wide)]
        return cv2.add(self._hazed(picture, region, random), flakes)


class CodedOcclusion(_AsCoded):
    """One blob per level in the lower half of the picture: a black core and a grey rim with a hard edge."""

    def _build(self) -> str:
        self._blur = _gaussian(BLOB_BLUR)
        return self._blur.calculated_by

    def _drawn(
        self, picture: np.ndarray | Picture, region: Region, random: np.random.Generator
    ) -> np.ndarray:
        rows, columns = picture.shape
        mask = np.full(picture.shape, WHITE, np.uint8)
        for size, across, down in random.random((self._level, 3)).tolist():
            radius = round(BLOB_RADII[0] + size * (BLOB_RADII[1] - BLOB_RADII[0]))
            lowest = rows - radius
            centre = round(across * (columns - 1)), round(rows / 2 + down * (lowest - rows / 2))
            cv2.circle(mask, centre, radius, 0, cv2.FILLED)
        mask = filtered(mask, region, self._blur.size // 2, self._blur)
        return np.where(mask < COVERED, mask, picture[region.part])


def _halved(region: Region, shape: tuple[int, int]) -> Region:
    """The region, enlarged so that halving it equals halving the whole; all of it for odd sizes."""
    if shape[0] % 2 or shape[1] % 2:
        return whole(shape)
    top, bottom, left, right = region
    return Region(top - top % 2, bottom + bottom % 2, left - left % 2, right + right % 2)


def _gaussian(sigma: float) -> Gaussian:
    return build_gaussian(sigma, 2 * _reach(sigma) + 1)


def _reach(sigma: float) -> int:
    return ceil(2.0 * sigma)


def _streak() -> Streak:
    way = np.rint(STREAK_LENGTH * np.array([-sin(STREAK_LEAN), cos(STREAK_LEAN)])).astype(np.int_)
    canvas = np.zeros((2 * STREAK_LENGTH, 2 * STREAK_LENGTH), np.uint8)
    cv2.line(canvas, (STREAK_LENGTH, 0), (STREAK_LENGTH + int(way[0]), int(way[1])), 1)
    row, column = canvas.nonzero()
    return Streak(np.column_stack((column - STREAK_LENGTH, row)), way)


def _flake(sigma: float) -> np.ndarray:
    """Grey levels (FLAKE x FLAKE, uint16) of a blurred white block."""
    block = np.zeros((FLAKE + 2 * FLAKE_REACH,) * 2, np.uint8)  # blurring mirrors the picture at its border
    block[2 * FLAKE_REACH : -2 * FLAKE_REACH, 2 * FLAKE_REACH : -2 * FLAKE_REACH] = WHITE
    inside = slice(FLAKE_REACH, -FLAKE_REACH)
    return _gaussian(sigma)(block)[inside, inside].astype(np.uint16)
