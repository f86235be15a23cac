"""Rain drops on the windscreen in front of the camera: they stay where they land until the wiper comes by."""

from math import tan

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import Scene

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


class Windscreen:
    """Drops of `diameters` (m, of those that land one after the other) landing on a car in rain.

    `density` is their number per m^3 of air.
    """

    def __init__(
        self, random: np.random.Generator, camera: CameraModel, density: float, diameters: np.ndarray
    ) -> None:
        self._size = camera.width // COARSE, camera.rows // COARSE
        area = DISTANCE**2 * camera.width / camera.fx * camera.rows / camera.fy
        self._per_metre = density * area  # drops for each metre of air that moves at the glass
        most = int(self._per_metre * _speed(FASTEST) * WIPE) + 1
        self._start = random.uniform(0.0, WIPE)
        self._sets = [
            _landed(random, camera, random.choice(diameters, size=most), self._size) for _ in range(SETS)
        ]

    def seen(self, picture: np.ndarray, scene: Scene) -> np.ndarray:
        """The picture through the glass; a new array."""
        wipe, since = divmod(scene.t + self._start, WIPE)
        places, sources, shares, ends = self._sets[int(wipe) % SETS]
        landed = int(self._per_metre * _speed(scene.v_ego) * since)
        end = ends[min(landed, ends.size - 1)]
        through = cv2.resize(picture, self._size, interpolation=cv2.INTER_AREA)
        through = cv2.GaussianBlur(through, (0, 0), BLUR).reshape(-1)
        seen = picture.copy()
        flat, place = seen.reshape(-1), places[:end]
        before = flat[place].astype(np.int16)
        flat[place] = before + ((through[sources[:end]] - before) * shares[:end] >> 6)
        return seen


def _speed(v_ego: float) -> float:
    """Speed (m/s) of drops against the glass, as if it stood upright."""
    return max(v_ego, 0.0) + FALL / tan(RAKE)


def _landed(
    random: np.random.Generator, camera: CameraModel, diameters: np.ndarray, size: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(places, sources, shares, ends) of drops in the order in which they land.

    For each pixel that a drop covers: its place in the picture, which pixel of the coarse picture is seen
    there, and its share in 64ths. The first k drops have the first ends[k] of them.
    """
    free = np.ones((camera.rows, camera.width), dtype=bool)
    grid = np.arange(free.size).reshape(free.shape)
    middles = random.uniform(size=(diameters.size, 2)) * (camera.width, camera.rows)
    shapes = np.exp(random.normal(0.0, 0.12, size=diameters.size))
    parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for (column, row), shape, radius in zip(
        middles, shapes, 0.5 * SPREAD * camera.fx / DISTANCE * diameters, strict=True
    ):
        right, columns = _across(column, radius * shape, camera.width)
        down, rows = _across(row, radius / shape, camera.rows)
        inner = 1.0 - np.sqrt(right**2 + (down**2)[:, None])
        share = np.clip(inner * (64.0 * radius / EDGE) + 32.0, 0.0, 64.0).astype(np.int16)
        there = (share > 0) & free[rows, columns]
        free[rows, columns] &= share <= 32  # a later drop hides a soft edge
        source = (_source(down, size[1]) * size[0])[:, None] + _source(right, size[0])
        parts.append((grid[rows, columns][there], source[there], share[there]))
    ends = np.concatenate([[0], np.cumsum([part[0].size for part in parts])])
    places, sources, shares = (np.concatenate(each) for each in zip(*parts, strict=True))
    return places, sources, shares, ends


def _across(middle: float, radius: float, size: int) -> tuple[np.ndarray, slice]:
    """Places in a drop, -1 to 1 and its edge, of the pixels it covers, and which of `size` these are."""
    first, end = max(int(middle - radius - EDGE), 0), min(int(middle + radius + EDGE) + 2, size)
    return (np.arange(first, end) - middle) / radius, slice(first, end)


def _source(turned: np.ndarray, size: int) -> np.ndarray:
    """Which of `size` pixels a drop shows at a place between -1 and 1 of its own: from the other end."""
    return np.clip(np.rint(0.5 * size * (1.0 - WIDE * turned)), 0, size - 1).astype(np.intp)
