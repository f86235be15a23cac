"""Particles in the air ahead of the camera, each where the car's motion and its fall take it.

A box of air that just holds what the camera sees up to its far end repeats in all three directions, in the
camera's axes (x right, y down, z ahead along the optical axis). The car drives into it, the particles fall
through it; who leaves at one side enters at the other. Places are kept as shares of the box.
"""

from itertools import pairwise
from math import cos, sin
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.canvas import splat, strokes
from selfdrive.sim.effects.effect import Scene

NEAREST = 0.25  # m: what is nearer to the lens is out of focus
FAINTEST = 0.03  # share of a pixel's light: a streak that takes less is not seen
COARSEST = 2  # halvings of the picture for wide particles


class Streaks(NamedTuple):
    """What n particles draw while the shutter is open."""

    start: np.ndarray  # (2, n) px, columns then rows
    end: np.ndarray
    width: np.ndarray  # (n,) px


class Particles:
    """Particles with diameters `size` and speeds of fall `speed`, (n,) in m and m/s, in a box `reach` m deep."""

    def __init__(
        self, random: np.random.Generator, camera: CameraModel, reach: float, size: np.ndarray, speed: np.ndarray
    ) -> None:
        self._camera, self._reach = camera, reach
        self._size, self._speed = size.astype(np.float32), speed.astype(np.float32)
        # Of a particle's own: the same for more particles of another size.
        across, self._down, self._ahead = random.uniform(size=(size.size, 3)).astype(np.float32).T.copy()
        self._across = across * camera.width - camera.cx  # px at the far end

    def streaks(self, scene: Scene, exposure: float) -> Streaks:
        """The streaks of all particles in view in `exposure` seconds from the scene's moment."""
        camera, lean, upright = self._camera, sin(self._camera.pitch), cos(self._camera.pitch)
        # A car that drives on sees all come nearer and, looking down, up.
        ahead = _turned(self._ahead, self._speed, scene, -upright / self._reach, lean / self._reach)
        ahead = np.maximum(ahead, 1e-3)
        left = camera.cx + self._across / ahead
        near = NEAREST / self._reach
        seen = np.flatnonzero((ahead > near) & (left > -40.0) & (left < camera.width + 40.0))
        ahead, left, speed, size = ahead[seen], left[seen], self._speed[seen], self._size[seen]
        tall = camera.rows / camera.fy * self._reach
        down = _turned(self._down[seen], speed, scene, lean / tall, upright / tall)
        down = (down * camera.rows - camera.cy) * np.float32(self._reach / camera.fy)  # m
        ahead *= np.float32(self._reach)
        later_ahead = ahead + exposure * (lean * speed - upright * np.float32(scene.v_ego))
        later_down = down + exposure * (upright * speed + lean * np.float32(scene.v_ego))
        later_ahead = np.maximum(later_ahead, np.float32(0.5 * NEAREST))
        start = np.stack([left, camera.cy + camera.fy * down / ahead])
        end = np.stack(
            [camera.cx + (left - camera.cx) * ahead / later_ahead, camera.cy + camera.fy * later_down / later_ahead]
        )
        inside = np.flatnonzero((end[1] > -2.0) & (start[1] < camera.rows + 2.0))
        return Streaks(start[:, inside], end[:, inside], camera.fx * size[inside] / ahead[inside])


def _turned(
    first: np.ndarray, speed: np.ndarray, scene: Scene, by_way: float, by_fall: float
) -> np.ndarray:
    """Shares of the box, 0 to 1, after the way driven and the fall moved particles by so many boxes a metre."""
    turned = first + (speed * np.float32(by_fall * scene.t) + np.float32(by_way * scene.position % 1.0))
    return turned - np.floor(turned)


def cover(streaks: Streaks, camera: CameraModel) -> np.ndarray:
    """Share of each pixel's light that streaks take up, 0 to 1, float32 (rows, width).

    A particle covers pi / 4 * width^2 pixels at a time and is spread evenly over its streak. Wide particles
    are drawn on a coarser grid and enlarged, which makes them wide and soft.
    """
    lengths = np.hypot(*(streaks.end - streaks.start))
    seen = 0.25 * np.pi * streaks.width**2 > FAINTEST * (lengths + 1.0)
    covered = None
    limits = [0.0, *(1.5 * 2.0**halving for halving in range(COARSEST)), np.inf]
    for halving, (least, most) in enumerate(pairwise(limits)):
        chosen = np.flatnonzero(seen & (streaks.width > least) & (streaks.width <= most))
        part = _drawn(Streaks(*(each[..., chosen] for each in streaks)), lengths[chosen], camera, 2**halving)
        covered = part if covered is None else cv2.add(covered, part)
    return np.minimum(covered, 1.0)


def _drawn(streaks: Streaks, lengths: np.ndarray, camera: CameraModel, scale: int) -> np.ndarray:
    # Pixel k of the coarse grid has its centre at scale * k + (scale - 1) / 2 of the fine one.
    shift = np.float32((scale - 1) / 2.0)
    start, end = (streaks.start - shift) / np.float32(scale), (streaks.end - shift) / np.float32(scale)
    counts = (lengths / scale).astype(np.intp) + 1
    _, columns, rows = strokes(start, end, counts)
    area = np.float32(0.25 * np.pi / scale**2) * streaks.width**2 / counts.astype(np.float32)
    shape = -(-camera.rows // scale), -(-camera.width // scale)
    levels = splat(columns, rows, np.repeat(area, counts), shape, wrap=False)
    if scale == 1:
        return levels
    fine = cv2.resize(levels, (shape[1] * scale, shape[0] * scale), interpolation=cv2.INTER_LINEAR)
    return fine[: camera.rows, : camera.width]
