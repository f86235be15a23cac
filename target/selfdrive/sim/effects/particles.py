"""Particles in the air ahead of the camera, moved by the car and their fall.

A box of air, just large enough for the camera's view up to its far end, repeats in all three directions of
the camera's axes (x right, y down, z ahead along the optical axis). Positions are shares of the box. Boxes of
different depths overlap: shallow ones hold particles too small to be visible far away.
"""

from math import cos, inf, sin
from typing import NamedTuple

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.canvas import splat, strokes
from selfdrive.sim.effects.effect import Scene
from selfdrive.sim.picture import Region

NEAREST_DISTANCE = 0.25  # m; anything closer is out of focus
FAINTEST_SHARE = 0.03  # share of a pixel's light; streaks that take less are invisible
COARSER_GRID_WIDTHS = 1.5, 3.0  # px; wider particles are drawn at half, or a quarter, of the resolution
POINT_SPACING = 1.3  # px between the points of a streak
GRID_MARGIN = 2  # px around a grid


class AirBox(NamedTuple):
    """n particles in a box of air."""

    depth: float  # m
    diameters: np.ndarray  # (n,) m
    fall_speeds: np.ndarray  # (n,) m/s


class Streaks(NamedTuple):
    """Streaks of n particles during the exposure; float32."""

    start: np.ndarray  # (2, n) px, columns then rows
    end: np.ndarray
    width: np.ndarray  # (n,) px


class Particles:
    def __init__(self, random: np.random.Generator, camera: CameraModel, boxes: list[AirBox]) -> None:
        self._camera = camera
        self._reaches = np.array([box.depth for box in boxes])
        self._counts = [box.diameters.size for box in boxes]
        self._reach = np.repeat(self._reaches, self._counts).astype(np.float32)
        self._size = np.concatenate([box.diameters for box in boxes]).astype(np.float32)
        self._speed = np.concatenate([box.fall_speeds for box in boxes]).astype(np.float32)
        first = random.uniform(size=(self._size.size, 3)).astype(np.float32)
        across, self._down, self._ahead = first.T.copy()
        self._across = across * camera.width - camera.cx  # px at the far end

    def streaks(self, scene: Scene, exposure: float) -> Streaks:
        """Streaks of all visible particles in `exposure` seconds from the scene's moment."""
        camera, lean, upright = self._camera, sin(self._camera.pitch), cos(self._camera.pitch)
        # While the car drives, everything comes nearer and, as the camera looks down, moves down.
        ahead = self._positions(self._ahead, scene, 1.0, -upright, lean) * self._reach
        ahead = np.maximum(ahead, 1e-3)
        column = camera.cx + self._across * self._reach / ahead
        in_view = np.flatnonzero(
            (ahead > NEAREST_DISTANCE) & (column > -40.0) & (column < camera.width + 40.0)
        )
        ahead, column, speed = ahead[in_view], column[in_view], self._speed[in_view]
        down = self._positions(self._down, scene, camera.rows / camera.fy, lean, upright)[in_view]
        down = (down * camera.rows - camera.cy) * (self._reach[in_view] / camera.fy)
        v_ego = float(scene.v_ego)
        later_ahead = np.maximum(ahead + exposure * (lean * speed - upright * v_ego), 0.5 * NEAREST_DISTANCE)
        later_down = down + exposure * (upright * speed + lean * v_ego)
        later_column = camera.cx + (column - camera.cx) * ahead / later_ahead
        start = np.stack([column, camera.cy + camera.fy * down / ahead])
        end = np.stack([later_column, camera.cy + camera.fy * later_down / later_ahead])
        width = camera.fx * self._size[in_view] / ahead
        inside = (end[1] > -GRID_MARGIN) & (start[1] < camera.rows + GRID_MARGIN)
        # A particle covers pi / 4 * width^2 pixels at a time, spread over its streak.
        visible = 0.25 * np.pi * width**2 > FAINTEST_SHARE * (_vector_lengths(end - start) + 1.0)
        chosen = np.flatnonzero(inside & visible)
        return Streaks(start[:, chosen], end[:, chosen], width[chosen])

    def _positions(
        self, first: np.ndarray, scene: Scene, tall: float, along: float, fall: float
    ) -> np.ndarray:
        """Positions, as shares of boxes `tall` times as long as their reach, after the particles moved by
        `along` per metre driven and by `fall` per metre fallen."""
        moved = self._speed * float(fall / tall * scene.t) / self._reach
        moved += first
        moved += np.repeat(self._driven_shares(scene, tall, along), self._counts)
        return moved - np.floor(moved)

    def _driven_shares(self, scene: Scene, tall: float, along: float) -> np.ndarray:
        driven = (along / tall * scene.position / self._reaches) % 1.0  # in double precision at any distance
        return driven.astype(np.float32)


class ParticleCover:
    """The share of each pixel's light that streaks take.

    Wide particles are drawn on coarser grids and enlarged, which makes them soft. All grids are on one sheet,
    the coarse ones side by side below the full one.
    """

    def __init__(self, camera: CameraModel) -> None:
        sizes = [
            (-(-camera.rows // s) + 2 * GRID_MARGIN, -(-camera.width // s) + 2 * GRID_MARGIN)
            for s in (1, 2, 4)
        ]
        corners = [(0, 0), (sizes[0][0], 0), (sizes[0][0], sizes[1][1])]
        self._sizes, self._places = sizes, corners
        self._sheet = np.zeros((sizes[0][0] + sizes[1][0], sizes[0][1]), dtype=np.float32)
        self._corners = np.array(corners, dtype=np.float32).T[::-1]  # columns, then rows
        self._ends = self._corners + np.array(sizes, dtype=np.float32).T[::-1] - 1.0

    def covered_shares(self, streaks: Streaks, region: Region) -> np.ndarray:
        """Shares in units of 1/255, uint8, in a region of the picture."""
        full, half, quarter = windows_of_grids(region, self._sizes)
        grids = self._grids((full, half, quarter))
        for grid in grids:
            grid.fill(0.0)
        self._draw(streaks, (full, half, quarter))
        grids[1] += _enlarge(grids[2], quarter, half)
        coarse = _enlarge(cv2.convertScaleAbs(grids[1], alpha=255.0), half, full)
        return cv2.add(cv2.convertScaleAbs(grids[0], alpha=255.0), coarse)

    def half_grid(self, region: Region) -> np.ndarray:
        """The half grid's values in a region, including the quarter grid's, after the last picture."""
        return self._grids(windows_of_grids(region, self._sizes))[1]

    def _grids(self, grid_windows: tuple[Region, ...]) -> list[np.ndarray]:
        return [
            self._sheet[row + window.top : row + window.bottom, column + window.left : column + window.right]
            for (row, column), window in zip(self._places, grid_windows, strict=True)
        ]

    def _draw(self, streaks: Streaks, grid_windows: tuple[Region, ...]) -> None:
        grid = np.searchsorted((*COARSER_GRID_WIDTHS, inf), streaks.width)
        scale = np.float32([1.0, 2.0, 4.0])[grid]
        # Pixel k of a coarse grid has its centre at scale * k + (scale - 1) / 2 of the full one.
        corner = self._corners[:, grid] + GRID_MARGIN - 0.5
        start, end = ((place + 0.5) / scale + corner for place in (streaks.start, streaks.end))
        # A point affects the pixels around it.
        least = np.float32([(window.left - 1, window.top - 1) for window in grid_windows]).T + self._corners
        most = np.float32([(window.right, window.bottom) for window in grid_windows]).T + self._corners
        least, most = np.maximum(least, self._corners), np.minimum(most, self._ends)
        there = (np.maximum(start, end) >= least[:, grid]) & (np.minimum(start, end) < most[:, grid])
        near = np.flatnonzero(there[0] & there[1])
        start, end, grid = start[:, near], end[:, near], grid[near]
        counts = (_vector_lengths(end - start) / POINT_SPACING).astype(np.intp) + 1
        share = (0.25 * np.pi) * (streaks.width[near] / scale[near]) ** 2 / counts.astype(np.float32)
        _, columns, rows = strokes(start, end, counts)
        grid = np.repeat(grid, counts)
        first, last = least[:, grid], most[:, grid]
        inside = np.flatnonzero(
            (columns >= first[0]) & (columns < last[0]) & (rows >= first[1]) & (rows < last[1])
        )
        splat(self._sheet, columns[inside], rows[inside], np.repeat(share, counts)[inside])


def windows_of_grids(region: Region, sizes: list[tuple[int, int]]) -> tuple[Region, Region, Region]:
    """The parts of the full, half and quarter grids that determine a region."""
    full = Region(*(end + GRID_MARGIN for end in region))
    half = _window_of_coarser_grid(full, sizes[1])
    return full, half, _window_of_coarser_grid(half, sizes[2])


def _window_of_coarser_grid(fine: Region, size: tuple[int, int]) -> Region:
    """The part of a grid of this size that determines `fine` in the grid of twice its resolution."""
    top, bottom, left, right = ((end + GRID_MARGIN) // 2 for end in fine)
    return Region(max(top - 1, 0), min(bottom + 2, size[0]), max(left - 1, 0), min(right + 2, size[1]))


def _enlarge(coarse: np.ndarray, window: Region, fine: Region) -> np.ndarray:
    """The region `fine` of a grid, from the `window` of the grid of half its size; both with margins."""
    twice = cv2.resize(coarse, None, fx=2.0, fy=2.0, interpolation=cv2.INTER_LINEAR)
    down, right = fine.top + GRID_MARGIN - 2 * window.top, fine.left + GRID_MARGIN - 2 * window.left
    return twice[down : down + fine.shape[0], right : right + fine.shape[1]]


def _vector_lengths(ways: np.ndarray) -> np.ndarray:
    across, down = ways
    return np.sqrt(across * across + down * down)
