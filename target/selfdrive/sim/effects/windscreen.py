"""Rain drops on the windscreen, which stay where they land until the wiper passes."""

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

GLASS_DISTANCE = 0.05  # m from lens to glass
GLASS_RAKE = 0.52  # rad between glass and road
DROP_SPREAD = 1.8  # a drop's diameter on the glass, relative to that in the air
DROP_FALL_SPEED = 6.5  # m/s, fall speed of drops of a few mm
DROP_EDGE_BLUR = 3.0  # px, blur of a drop's edge, which is out of focus
WIPE_PERIOD = 1.0  # s between wipes
MOST_SPEED = 40.0  # m/s; drops are prepared up to this speed
DROP_SET_COUNT = 3  # number of wipes with different drops, after which they repeat
REDUCTION = 8  # px of the picture per pixel of its reduced copy seen through drops
VIEW_BLUR = 5.0  # px of the reduced copy: glass and the view through drops are out of focus
VIEW_SHARE = 0.9  # share of the picture that a drop shows, upside down like a strong lens


class DropPixels(NamedTuple):
    """Pixels of drops in the order of landing; drop k has those from ends[k] to ends[k + 1]."""

    places: np.ndarray  # in the picture
    sources: np.ndarray  # pixel of the reduced picture seen there
    shares: np.ndarray  # in 64ths, int16
    ends: np.ndarray

    @classmethod
    def from_drops(cls, drops: list[np.ndarray]) -> "DropPixels":
        places, sources, shares = np.concatenate(drops, axis=1)
        ends = np.concatenate([[0], np.cumsum([drop.shape[1] for drop in drops])])
        return cls(places, sources, shares.astype(np.int16), ends)

    def in_region(self, region: Region, columns: int) -> "DropPixels":
        """The pixels in a region of the picture, which has `columns` columns; their places are then relative
        to the region."""
        row, column = np.divmod(self.places, columns)
        down, right = row - region.top, column - region.left
        rows, width = region.shape
        there = (down >= 0) & (down < rows) & (right >= 0) & (right < width)
        ends = np.concatenate([[0], np.cumsum(there)])[self.ends]
        return DropPixels((down * width + right)[there], self.sources[there], self.shares[there], ends)

    def of_first_drops(self, drops: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        end = self.ends[min(drops, self.ends.size - 1)]
        return self.places[:end], self.sources[:end], self.shares[:end]


class Windscreen:
    """Drops of `diameters` (m, in order of landing) on a car in rain.

    `density` is their number per m^3 of air. `shrink` and `blur` make the picture that drops show.
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
        self._size = camera.width // REDUCTION, camera.rows // REDUCTION
        area = GLASS_DISTANCE**2 * camera.width / camera.fx * camera.rows / camera.fy
        self._drops_per_metre = density * area  # drops per metre of air that passes the glass
        most = int(self._drops_per_metre * _drop_speed(MOST_SPEED) * WIPE_PERIOD) + 1
        self._region: Region | None = None
        self._start = random.uniform(0.0, WIPE_PERIOD)
        self._drop_sets = [
            _land_drops(random, camera, random.choice(diameters, size=most), self._size)
            for _ in range(DROP_SET_COUNT)
        ]

    def look_through(self, picture: np.ndarray, region: Region, scene: Scene) -> np.ndarray:
        wipe, since = divmod(scene.t + self._start, WIPE_PERIOD)
        wholly, edges = self._drops_in_region(region, picture.shape[1])[int(wipe) % DROP_SET_COUNT]
        landed = int(self._drops_per_metre * _drop_speed(scene.v_ego) * since)
        through = self._blur(self._shrink(picture, self._size)).reshape(-1)
        result = picture[region.part].copy()
        flat = result.reshape(-1)
        places, sources, shares = edges.of_first_drops(landed)
        before = flat[places].astype(np.int16)
        flat[places] = before + ((through[sources] - before) * shares >> 6)
        places, sources, _ = wholly.of_first_drops(landed)
        flat[places] = through[sources]
        return result

    def _drops_in_region(self, region: Region, columns: int) -> list[tuple[DropPixels, DropPixels]]:
        if region != self._region:
            self._region_drops = [
                tuple(part.in_region(region, columns) for part in drops) for drops in self._drop_sets
            ]
            self._region = region
        return self._region_drops


def shrink_picture(picture: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    return cv2.resize(picture, size, interpolation=cv2.INTER_AREA)


def _drop_speed(v_ego: float) -> float:
    """Speed (m/s) of drops relative to the glass, as if the glass were upright."""
    return max(v_ego, 0.0) + DROP_FALL_SPEED / tan(GLASS_RAKE)


def _land_drops(
    random: np.random.Generator, camera: CameraModel, diameters: np.ndarray, size: tuple[int, int]
) -> tuple[DropPixels, DropPixels]:
    free = np.ones((camera.rows, camera.width), dtype=bool)
    grid = np.arange(free.size).reshape(free.shape)
    middles = random.uniform(size=(diameters.size, 2)) * (camera.width, camera.rows)
    shapes = each(exp, random.normal(0.0, 0.12, size=diameters.size))
    drops: list[np.ndarray] = []
    for (column, row), shape, radius in zip(
        middles, shapes, 0.5 * DROP_SPREAD * camera.fx / GLASS_DISTANCE * diameters, strict=True
    ):
        right, columns = _pixels_across_drop(column, radius * shape, camera.width)
        down, rows = _pixels_across_drop(row, radius / shape, camera.rows)
        inner = 1.0 - np.sqrt(right**2 + (down**2)[:, None])
        share = np.clip(inner * (64.0 * radius / DROP_EDGE_BLUR) + 32.0, 0.0, 64.0).astype(np.intp)
        there = (share > 0) & free[rows, columns]
        free[rows, columns] &= share <= 32  # a later drop hides a soft edge
        source = (_source_pixels(down, size[1]) * size[0])[:, None] + _source_pixels(right, size[0])
        drops.append(np.stack([grid[rows, columns][there], source[there], share[there]]))
    wholly = DropPixels.from_drops([drop[:, drop[2] == 64] for drop in drops])
    return wholly, DropPixels.from_drops([drop[:, drop[2] < 64] for drop in drops])


def _pixels_across_drop(middle: float, radius: float, size: int) -> tuple[np.ndarray, slice]:
    """Positions in a drop (-1 to 1 at its edges) of the pixels that it covers, and their slice of `size`."""
    first, end = (
        max(int(middle - radius - DROP_EDGE_BLUR), 0),
        min(int(middle + radius + DROP_EDGE_BLUR) + 2, size),
    )
    return (np.arange(first, end) - middle) / radius, slice(first, end)


def _source_pixels(turned: np.ndarray, size: int) -> np.ndarray:
    """The pixel, of `size`, that a drop shows at a position from -1 to 1: at the opposite end."""
    return np.clip(np.rint(0.5 * size * (1.0 - VIEW_SHARE * turned)), 0, size - 1).astype(np.intp)
