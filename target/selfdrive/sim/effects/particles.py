"""Particles in the air ahead of the camera, each where the car's motion and its fall take it.

A box of air that just holds what the camera sees up to its far end repeats in all three directions, in the
camera's axes (x right, y down, z ahead along the optical axis). The car drives into it, the particles fall
through it; who leaves at one side enters at the other. Places are kept as shares of the box.
"""

from itertools import pairwise
from math import cos, inf, sin
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.canvas import splat, strokes
from selfdrive.sim.effects.effect import Scene

NEAREST = 0.25  # m: what is nearer to the lens is out of focus
FAINTEST = 0.03  # share of a pixel's light: a streak that takes less is not seen
SOFT_WIDTHS = 0.0, 1.5, 3.0, inf  # px: drawn on the full grid, on half of it, on a quarter
SPACING = 1.3  # px between the points that make a streak
MARGIN = 2  # px around a grid


class Streaks(NamedTuple):
    """What n particles draw while the shutter is open; float32."""

    start: np.ndarray  # (2, n) px, columns then rows
    end: np.ndarray
    width: np.ndarray  # (n,) px


class Particles:
    """Particles of diameters `size` (m, (n,)) and speeds of fall `speed` (m/s) in a box `reach` m deep."""

    def __init__(
        self,
        random: np.random.Generator,
        camera: CameraModel,
        reach: float,
        size: np.ndarray,
        speed: np.ndarray,
    ) -> None:
        self._camera, self._reach = camera, reach
        self._size, self._speed = size.astype(np.float32), speed.astype(np.float32)
        across, self._down, self._ahead = random.uniform(size=(size.size, 3)).astype(np.float32).T.copy()
        self._across = across * camera.width - camera.cx  # px at the far end

    def streaks(self, scene: Scene, exposure: float) -> Streaks:
        """The streaks of all particles in view in `exposure` seconds from the scene's moment."""
        camera, lean, upright = self._camera, sin(self._camera.pitch), cos(self._camera.pitch)
        # A car that drives on sees all come nearer and, as it looks down, sink.
        ahead = _moved(self._ahead, self._speed, scene, -upright / self._reach, lean / self._reach)
        ahead = np.maximum(ahead, 1e-3)
        left = camera.cx + self._across / ahead
        seen = np.flatnonzero((ahead > NEAREST / self._reach) & (left > -40.0) & (left < camera.width + 40.0))
        ahead, left, speed = ahead[seen], left[seen], self._speed[seen]
        tall = camera.rows / camera.fy * self._reach
        down = _moved(self._down[seen], speed, scene, lean / tall, upright / tall)
        down = (down * camera.rows - camera.cy) * (self._reach / camera.fy)
        ahead *= self._reach
        v_ego = float(scene.v_ego)
        later_ahead = np.maximum(ahead + exposure * (lean * speed - upright * v_ego), 0.5 * NEAREST)
        later_down = down + exposure * (upright * speed + lean * v_ego)
        later_left = camera.cx + (left - camera.cx) * ahead / later_ahead
        start = np.stack([left, camera.cy + camera.fy * down / ahead])
        end = np.stack([later_left, camera.cy + camera.fy * later_down / later_ahead])
        width = camera.fx * self._size[seen] / ahead
        inside = (end[1] > -MARGIN) & (start[1] < camera.rows + MARGIN)
        # A particle covers pi / 4 * width^2 pixels at a time, and its streak's all in turn.
        visible = 0.25 * np.pi * width**2 > FAINTEST * (np.hypot(*(end - start)) + 1.0)
        chosen = np.flatnonzero(inside & visible)
        return Streaks(start[:, chosen], end[:, chosen], width[chosen])


def _moved(first: np.ndarray, speed: np.ndarray, scene: Scene, by_way: float, by_fall: float) -> np.ndarray:
    """Shares of the box after particles moved by so many boxes for a metre driven and a metre fallen."""
    moved = first + (speed * float(by_fall * scene.t) + float(by_way * scene.position % 1.0))
    return moved - np.floor(moved)


class Cover:
    """The share of each pixel's light that streaks take; its memory is used again for each picture.

    Wide streaks are drawn on a coarser grid and enlarged, which makes them wide and soft.
    """

    def __init__(self, camera: CameraModel) -> None:
        rows, width = camera.rows, camera.width
        self._inside = slice(MARGIN, MARGIN + rows), slice(MARGIN, MARGIN + width)
        self._grids = [
            np.zeros((-(-rows // scale) + 2 * MARGIN, -(-width // scale) + 2 * MARGIN), dtype=np.float32)
            for scale in (1, 2, 4)
        ]

    def taken(self, streaks: Streaks) -> np.ndarray:
        """Shares in parts of 255, uint8 (rows, width)."""
        full, half, quarter = self._grids
        for number, (grid, (least, most)) in enumerate(zip(self._grids, pairwise(SOFT_WIDTHS), strict=True)):
            grid.fill(0.0)
            chosen = np.flatnonzero((streaks.width > least) & (streaks.width <= most))
            if chosen.size:
                _draw(Streaks(*(each[..., chosen] for each in streaks)), grid, 2**number)
        half += _enlarged(quarter, half.shape)
        coarse = _enlarged(cv2.convertScaleAbs(half, alpha=255.0), full.shape)
        return cv2.add(cv2.convertScaleAbs(full, alpha=255.0)[self._inside], coarse[self._inside])


def _draw(streaks: Streaks, grid: np.ndarray, scale: int) -> None:
    # Pixel k of a coarse grid has its centre at scale * k + (scale - 1) / 2 of the full one.
    shift = (scale - 1) / 2.0
    start, end = (streaks.start - shift) / scale, (streaks.end - shift) / scale
    counts = (np.hypot(*(end - start)) / SPACING).astype(np.intp) + 1
    _, columns, rows = strokes(start + MARGIN, end + MARGIN, counts)
    shares = np.repeat((0.25 * np.pi / scale**2) * streaks.width**2 / counts.astype(np.float32), counts)
    height, width = grid.shape
    inside = np.flatnonzero((columns >= 0.0) & (columns < width - 1) & (rows >= 0.0) & (rows < height - 1))
    splat(grid, columns[inside], rows[inside], shares[inside])


def _enlarged(coarse: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """A grid of half the size on a finer one of this shape; both have their margins."""
    fine = cv2.resize(coarse, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_LINEAR)
    return fine[MARGIN : MARGIN + shape[0], MARGIN : MARGIN + shape[1]]
