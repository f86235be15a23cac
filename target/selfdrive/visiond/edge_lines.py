"""Straight lines through clusters of edges, and which of them bound the lane."""

from dataclasses import dataclass

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.visiond.detector import RoadLine
from selfdrive.visiond.road_region import RoadRegion

MIN_PIXELS = 24  # of a cluster that may be a line
MIN_ROWS = 3.0  # standard deviation of such a cluster's rows
MAX_SLOPE = 0.15  # a line that leads further from the car's heading is none of its lane's
BESIDE = 8.0  # m ahead: where it is decided which line is nearest
SAME = 0.4  # m further away there, a larger cluster is the better one to begin with
ONE_LINE = 0.2  # m: clusters whose pixels are no further from a line, on average, are pieces of it
SURE_PIXELS = 80.0  # edge pixels of a line about which there is no doubt
SURE_SPREAD = 0.15  # m: root mean square of their distances from the line that halves its probability


@dataclass(frozen=True, slots=True)
class _Points:
    """Edge pixels in clusters: row and column in the picture, cluster, and m to the pixel."""

    row: np.ndarray
    column: np.ndarray
    label: np.ndarray
    scale: np.ndarray


class EdgeLines:
    """Fits lines in the region of one camera's pictures, and tells where on the road they are."""

    def __init__(self, model: CameraModel, region: RoadRegion) -> None:
        self._model = model
        self._first = region.first_row, region.first_column
        rows = np.arange(region.shape[0]) + region.first_row
        self._scale = np.array([model.metres_per_pixel(row) for row in rows])

    def nearest(self, mask: np.ndarray, labels: np.ndarray) -> tuple[RoadLine | None, RoadLine | None]:
        """The lines next to the car, left and right, of the clusters `labels` of the pixels in `mask`."""
        row, column = np.divmod(np.flatnonzero(mask)[labels >= 0], mask.shape[1])
        first_row, first_column = self._first
        points = _Points(row + first_row, column + first_column, labels[labels >= 0], self._scale[row])
        if not row.size:
            return None, None
        size, spread, a, b = _fit(points)
        y, slope = self._model.line_on_road(a, b)
        beside = y + BESIDE * slope
        fit = (size >= MIN_PIXELS) & (spread >= MIN_ROWS) & (np.abs(slope) <= MAX_SLOPE)
        return tuple(
            self._line(np.where(fit & (side * beside > 0.0), side * beside, np.inf), size, a, b, points)
            for side in (1.0, -1.0)
        )

    def _line(
        self, away: np.ndarray, size: np.ndarray, a: np.ndarray, b: np.ndarray, points: _Points
    ) -> RoadLine | None:
        """The line that begins with the cluster which is least `away` (m), None where none is a line."""
        least = away.min()
        if not np.isfinite(least):
            return None
        begin = np.argmax(np.where(away <= least + SAME, size, 0))
        distance = np.abs(points.column - a[begin] * points.row - b[begin]) * points.scale
        pieces = np.bincount(points.label, distance) <= ONE_LINE * size
        pieces[begin] = True
        return self._through(points, pieces.take(points.label))

    def _through(self, points: _Points, own: np.ndarray) -> RoadLine:
        """The line through its own points, and how sure it is."""
        row, column, scale = points.row[own], points.column[own], points.scale[own]
        line = _Points(row, column, np.zeros(row.size, np.intp), scale)
        a, b = (float(value[0]) for value in _fit(line)[2:])
        away = (column - a * row - b) * scale
        doubt = float(np.mean(away**2)) / SURE_SPREAD**2
        y, slope = self._model.line_on_road(a, b)
        return RoadLine(y=y, slope=slope, prob=min(1.0, row.size / SURE_PIXELS) / (1.0 + doubt))


def _fit(points: _Points) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """For each cluster: pixels, standard deviation of their rows, a and b of column = a * row + b."""
    row, column = points.row.astype(float), points.column.astype(float)
    size = np.bincount(points.label)
    mean_row, mean_column = (np.bincount(points.label, value) / size for value in (row, column))
    row -= mean_row.take(points.label)
    column -= mean_column.take(points.label)
    power = np.bincount(points.label, row * row)
    a = np.bincount(points.label, row * column) / np.maximum(power, 1.0)
    return size, np.sqrt(power / size), a, mean_column - a * mean_row
