"""Rain drops on the windscreen in front of the camera: they stay where they land until the wiper comes by."""

from collections.abc import Callable
from math import exp, tan
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.array_math import each
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import Scene
from selfdrive.sim.effects.gaussian import Gaussian
from selfdrive.sim.picture import Region

DISTANCE = 0.05  # m from lens to glass
RAKE = 0.52  # rad between glass and road
SPREAD = 1.8  # diameter of a drop on the glass, in its diameters in the air
FALL = 6.5  # m/s: of drops of some mm
EDGE = 3.0  # px: a drop's edge is out of focus
WIPE = 1.0  # s from wipe to wipe
FASTEST = 40.0  # m/s: beyond, no more drops are kept ready
SETS = 3  # drops of so many wipes, which then repeat
COARSE = 8  # px of the picture to one of that which is seen through drops
BLUR = 5.0  # of these: glass is out of focus, and so is what drops show
WIDE = 0.9  # share of the picture that a drop shows, upside down, as a strong lens does


class Pixels(NamedTuple):
    """Pixels of drops in the order in which these land; drop k has the ones from ends[k] to ends[k + 1]."""

    places: np.ndarray  # in the picture
    sources: np.ndarray  # which pixel of the coarse picture is seen there
    shares: np.ndarray  # in 64ths, int16
    ends: np.ndarray

    @classmethod
    def of(cls, drops: list[np.ndarray]) -> "Pixels":
        """From an array of places, sources and shares for each drop."""
        places, sources, shares = np.concatenate(drops, axis=1)
        ends = np.concatenate([[0], np.cumsum([drop.shape[1] for drop in drops])])
        return cls(places, sources, shares.astype(np.int16), ends)

    def within(self, region: Region, columns: int) -> "Pixels":
        """Those in a region of the picture, which has so many columns; their places are the region's."""
        row, column = np.divmod(self.places, columns)
        down, right = row - region.top, column - region.left
        rows, width = region.shape
        there = (down >= 0) & (down < rows) & (right >= 0) & (right < width)
        ends = np.concatenate([[0], np.cumsum(there)])[self.ends]
        return Pixels((down * width + right)[there], self.sources[there], self.shares[there], ends)

    def first(self, drops: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Places, sources and shares of so many drops."""
        end = self.ends[min(drops, self.ends.size - 1)]
        return self.places[:end], self.sources[:end], self.shares[:end]


class Windscreen:
    """Drops of `diameters` (m, of those that land one after the other) landing on a car in rain.

    `density` is their number per m^3 of air. What drops show is made by `shrink` and `blur`.
    """

    def __init__(
        self,
        random: np.random.Generator,
        camera: CameraModel,
        density: float,
        diameters: np.ndarray,
        shrink: Callable[[np.ndarray, tuple[int, int]], np.ndarray],
        blur: Gaussian,
    ) -> None:
        self._shrink, self._blur = shrink, blur
        self._size = camera.width // COARSE, camera.rows // COARSE
        area = DISTANCE**2 * camera.width / camera.fx * camera.rows / camera.fy
        self._per_metre = density * area  # drops for each metre of air that moves at the glass
        most = int(self._per_metre * _speed(FASTEST) * WIPE) + 1
        self._region: Region | None = None
        self._start = random.uniform(0.0, WIPE)
        self._sets = [
            _landed(random, camera, random.choice(diameters, size=most), self._size) for _ in range(SETS)
        ]

    def seen(self, picture: np.ndarray, region: Region, scene: Scene) -> np.ndarray:
        """The picture's region through the glass; a new array."""
        wipe, since = divmod(scene.t + self._start, WIPE)
        wholly, edges = self._landing(region, picture.shape[1])[int(wipe) % SETS]
        landed = int(self._per_metre * _speed(scene.v_ego) * since)
        through = self._blur(self._shrink(picture, self._size)).reshape(-1)
        seen = picture[region.part].copy()
        flat = seen.reshape(-1)
        places, sources, shares = edges.first(landed)
        before = flat[places].astype(np.int16)
        flat[places] = before + ((through[sources] - before) * shares >> 6)
        places, sources, _ = wholly.first(landed)
        flat[places] = through[sources]
        return seen

    def _landing(self, region: Region, columns: int) -> list[tuple[Pixels, Pixels]]:
        """The sets of drops in a region; kept, as all pictures of a run are asked for the same one."""
        if region != self._region:
            self._seen = [tuple(part.within(region, columns) for part in drops) for drops in self._sets]
            self._region = region
        return self._seen


def shrunk(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """The picture in so many columns and rows, each pixel the mean of what it stands for."""
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _speed(v_ego: float) -> float:
    """Speed (m/s) of drops against the glass, as if it stood upright."""
    return max(v_ego, 0.0) + FALL / tan(RAKE)


def _landed(
    random: np.random.Generator, camera: CameraModel, diameters: np.ndarray, size: tuple[int, int]
) -> tuple[Pixels, Pixels]:
    """Pixels that drops of these diameters cover wholly, and those at their edges."""
    free = np.ones((camera.rows, camera.width), dtype=bool)
    grid = np.arange(free.size).reshape(free.shape)
    middles = random.uniform(size=(diameters.size, 2)) * (camera.width, camera.rows)
    shapes = each(exp, random.normal(0.0, 0.12, size=diameters.size))
    drops: list[np.ndarray] = []
    for (column, row), shape, radius in zip(
        middles, shapes, 0.5 * SPREAD * camera.fx / DISTANCE * diameters, strict=True
    ):
        right, columns = _across(column, radius * shape, camera.width)
        down, rows = _across(row, radius / shape, camera.rows)
        inner = 1.0 - np.sqrt(right**2 + (down**2)[:, None])
        share = np.clip(inner * (64.0 * radius / EDGE) + 32.0, 0.0, 64.0).astype(np.intp)
        there = (share > 0) & free[rows, columns]
        free[rows, columns] &= share <= 32  # a later drop hides a soft edge
        source = (_source(down, size[1]) * size[0])[:, None] + _source(right, size[0])
        drops.append(np.stack([grid[rows, columns][there], source[there], share[there]]))
    wholly = Pixels.of([drop[:, drop[2] == 64] for drop in drops])
    return wholly, Pixels.of([drop[:, drop[2] < 64] for drop in drops])


def _across(middle: float, radius: float, size: int) -> tuple[np.ndarray, slice]:
    """Places in a drop, -1 to 1 and its edge, of the pixels it covers, and which of `size` these are."""
    first, end = max(int(middle - radius - EDGE), 0), min(int(middle + radius + EDGE) + 2, size)
    return (np.arange(first, end) - middle) / radius, slice(first, end)


def _source(turned: np.ndarray, size: int) -> np.ndarray:
    """Which of `size` pixels a drop shows at a place between -1 and 1 of its own: from the other end."""
    return np.clip(np.rint(0.5 * size * (1.0 - WIDE * turned)), 0, size - 1).astype(np.intp)
