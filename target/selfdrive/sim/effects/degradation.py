"""Measures how much an effect degrades a picture of the road, compared with the clean one."""

from typing import NamedTuple

import cv2
import numpy as np
from skimage.metrics import peak_signal_noise_ratio

from selfdrive.common.camera_model import CameraModel

NEAR, FAR = 5.0, 30.0  # m, measured part of the road
BESIDE = 0.35  # m from a line's middle to bare road
INNER = 0.5  # m; anything nearer to a line is not part of the lane's inside
SAME = 0.5  # an edge with at least this share of a mark's edge is as strong as a mark's
NOTICED = 8.0  # grey levels
WEAKEST = 32.0  # Sobel value of a step of 8 grey levels; anything less is no edge


class Severity(NamedTuple):
    psnr: float  # dB relative to the clean picture; infinite if equal
    contrast: float  # grey levels, between marks and the road beside them
    false_edges: float  # share of the lane's inside with an edge as strong as a mark's


class RoadGauge:
    def __init__(self, model: CameraModel, lines: tuple[tuple[float, float], tuple[float, float]]) -> None:
        """`lines` are (y, slope) of the lane's left and right line in m; both are solid."""
        self._rows = np.arange(int(model.row(FAR)) + 1, min(int(model.row(NEAR)), model.rows - 1) + 1)
        scales = np.array([model.metres_per_pixel(row) for row in self._rows])
        self._columns = []
        for y, slope in lines:
            a, b = model.line_in_picture(y, slope)
            self._columns.append(a * self._rows + b)
        self._beside = BESIDE / scales
        left, right = self._columns[0] + INNER / scales, self._columns[1] - INNER / scales
        columns = np.arange(model.width)
        self._inside = (columns > left[:, None]) & (columns < right[:, None])

    def measure(self, clean: np.ndarray, seen: np.ndarray) -> Severity:
        same, contrast = np.array_equal(clean, seen), self._contrast(seen)
        # Marks' edges fade with their contrast; measured in the picture, they would include dirt on them.
        mark_edge = self._mark_edge(clean) * contrast / self._contrast(clean)
        edges = self._edges(seen)[self._inside]
        return Severity(
            psnr=float("inf") if same else float(peak_signal_noise_ratio(clean, seen, data_range=255)),
            contrast=contrast,
            false_edges=float((edges > max(SAME * mark_edge, WEAKEST)).mean()),
        )

    def covered(self, seen: np.ndarray) -> float:
        """Share of the lane's inside where a uniform grey picture, `seen` through an effect, noticeably
        differs from the median. Valid up to about one half."""
        levels = seen[self._rows][self._inside].astype(float)
        return float((np.abs(levels - np.median(levels)) >= NOTICED).mean())

    def _contrast(self, picture: np.ndarray) -> float:
        differences = []
        for columns in self._columns:
            mark = self._levels(picture, columns)
            road = [self._levels(picture, columns + side * self._beside) for side in (-1.0, 1.0)]
            differences.append(mark - 0.5 * (road[0] + road[1]))
        return float(np.nanmean(differences))

    def _mark_edge(self, picture: np.ndarray) -> float:
        edges = self._edges(picture)
        width = picture.shape[1]
        reach = np.arange(-12, 13)
        near = []
        for columns in self._columns:
            places = np.rint(columns).astype(int)[:, None] + reach
            there = ((places[:, 0] >= 0) & (places[:, -1] < width)).nonzero()[0]
            near.append(edges[there[:, None], places[there]].max(axis=1))
        return float(np.median(np.concatenate(near)))

    def _edges(self, picture: np.ndarray) -> np.ndarray:
        return np.abs(cv2.Sobel(picture, cv2.CV_32F, 1, 0)[self._rows])

    def _levels(self, picture: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Levels at these columns, one per row, NaN outside the picture."""
        places = np.rint(columns).astype(int)
        inside = (places >= 0) & (places < picture.shape[1])
        levels = picture[self._rows, np.clip(places, 0, picture.shape[1] - 1)].astype(float)
        return np.where(inside, levels, np.nan)
