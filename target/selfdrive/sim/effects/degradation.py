"""Measures how much an effect degrades a picture of the road, compared with the clean one."""

from typing import NamedTuple

import cv2
import numpy as np
from skimage.metrics import peak_signal_noise_ratio

from selfdrive.common.camera_model import CameraModel

MEASURED_FROM, MEASURED_TO = 5.0, 30.0  # m, measured part of the road
ROAD_BESIDE_LINE = 0.35  # m from a line's middle to bare road
LANE_INSIDE_MARGIN = 0.5  # m; anything nearer to a line is not part of the lane's inside
MIN_SHARE_OF_MARK_EDGE = 0.5  # an edge with at least this share of a mark's edge is as strong as a mark's
MIN_NOTICED_PIXEL_CHANGE = 8.0  # grey levels, the least difference of a covered pixel
MIN_EDGE_SOBEL = 32.0  # Sobel value of a step of 8 grey levels; anything less is no edge


class Degradation(NamedTuple):
    psnr: float  # dB relative to the clean picture; infinite if equal
    mark_contrast: float  # grey levels, between marks and the road beside them
    false_edges: float  # share of the lane's inside with an edge as strong as a mark's


class DegradationGauge:
    def __init__(self, model: CameraModel, lines: tuple[tuple[float, float], tuple[float, float]]) -> None:
        """`lines` are (y, slope) of the lane's left and right line in m; both are solid."""
        self._rows = np.arange(
            int(model.row(MEASURED_TO)) + 1, min(int(model.row(MEASURED_FROM)), model.rows - 1) + 1
        )
        scales = np.array([model.metres_per_pixel(row) for row in self._rows])
        self._line_columns = []
        for y, slope in lines:
            a, b = model.line_in_picture(y, slope)
            self._line_columns.append(a * self._rows + b)
        self._beside = ROAD_BESIDE_LINE / scales
        left, right = (
            self._line_columns[0] + LANE_INSIDE_MARGIN / scales,
            self._line_columns[1] - LANE_INSIDE_MARGIN / scales,
        )
        columns = np.arange(model.width)
        self._inside = (columns > left[:, None]) & (columns < right[:, None])

    def measure(self, clean: np.ndarray, affected: np.ndarray) -> Degradation:
        same, contrast = np.array_equal(clean, affected), self._measure_mark_contrast(affected)
        # Marks' edges fade with their contrast; measured in the picture, they would include dirt on them.
        mark_edge = self._measure_mark_edge(clean) * contrast / self._measure_mark_contrast(clean)
        edges = self._horizontal_edges(affected)[self._inside]
        return Degradation(
            psnr=float("inf") if same else float(peak_signal_noise_ratio(clean, affected, data_range=255)),
            mark_contrast=contrast,
            false_edges=float((edges > max(MIN_SHARE_OF_MARK_EDGE * mark_edge, MIN_EDGE_SOBEL)).mean()),
        )

    def covered_share(self, affected: np.ndarray) -> float:
        """Share of the lane's inside where a uniform grey picture, `affected` by an effect, noticeably
        differs from the median. Valid up to about one half."""
        levels = affected[self._rows][self._inside].astype(float)
        return float((np.abs(levels - np.median(levels)) >= MIN_NOTICED_PIXEL_CHANGE).mean())

    def _measure_mark_contrast(self, picture: np.ndarray) -> float:
        differences = []
        for columns in self._line_columns:
            mark = self._levels_at(picture, columns)
            road = [self._levels_at(picture, columns + side * self._beside) for side in (-1.0, 1.0)]
            differences.append(mark - 0.5 * (road[0] + road[1]))
        return float(np.nanmean(differences))

    def _measure_mark_edge(self, picture: np.ndarray) -> float:
        edges = self._horizontal_edges(picture)
        width = picture.shape[1]
        reach = np.arange(-12, 13)
        near = []
        for columns in self._line_columns:
            places = np.rint(columns).astype(int)[:, None] + reach
            inside = ((places[:, 0] >= 0) & (places[:, -1] < width)).nonzero()[0]
            near.append(edges[inside[:, None], places[inside]].max(axis=1))
        return float(np.median(np.concatenate(near)))

    def _horizontal_edges(self, picture: np.ndarray) -> np.ndarray:
        return np.abs(cv2.Sobel(picture, cv2.CV_32F, 1, 0)[self._rows])

    def _levels_at(self, picture: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Levels at these columns, one per row, NaN outside the picture."""
        places = np.rint(columns).astype(int)
        inside = (places >= 0) & (places < picture.shape[1])
        levels = picture[self._rows, np.clip(places, 0, picture.shape[1] - 1)].astype(float)
        return np.where(inside, levels, np.nan)
