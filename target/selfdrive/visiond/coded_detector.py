"""The lane detector as the paper's authors coded it, which is less selective than the one in their text.

Each window with a mark is used independently. Edges are clustered by linkage, and the two clusters next to
the picture's middle are the lane's lines, whatever their shape. Their net is unpublished; this one is ours.
"""

from collections.abc import Sequence
from math import pi, sqrt

import cv2
import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from selfdrive.common.array_math import dot
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.messages import CameraView
from selfdrive.visiond.detector import LANE_WIDTH, LaneLines, RoadLine
from selfdrive.visiond.hog import FEATURES, STRIDE, WINDOW, Hog, windows
from selfdrive.visiond.lane_net import LaneNet

WIDTH, ROWS = 640, 480  # px, the size of pictures for all positions below
FIRST_ROW, FIRST_COLUMN = 235, 90  # of the windows
WINDOWS = 6, 29  # down, across
SIZE = tuple((count - 1) * STRIDE + WINDOW for count in WINDOWS)  # px of the part that they cover
PART = slice(FIRST_ROW, FIRST_ROW + SIZE[0]), slice(FIRST_COLUMN, FIRST_COLUMN + SIZE[1])
THRESHOLD = 4.0  # lowest log odds of a window with a mark; see visiond_lab.calibrate_as_coded
STEEP = 4.0  # an edge's squared gradient, as a multiple of the window's mean
LEAST_EDGES = 25  # px, in a window that is used
NEIGHBOURS = 5  # points within the clusters' radius if all were evenly spread
LEAST_POINTS = 30  # of a cluster
MIDDLE = 320  # column that separates left and right lines
ROW = 278  # where lines are read
INWARD = 3  # px by which a line is read closer to the middle
METRES_PER_PIXEL = 0.024856
MISSING = 0  # column of a line without a cluster


class CodedDetector:
    """Examines pictures of 640 x 480 pixels and remembers where it last saw the lines.

    Its lines and path have probability 1 and are parallel to the car. `calculated_by` identifies the compiled
    code in use, if any. Raises ConfigError for a camera with pictures of another size.
    """

    calculated_by = ""

    def __init__(self, model: CameraModel, threshold: float = THRESHOLD) -> None:
        if (model.width, model.rows) != (WIDTH, ROWS):
            raise ConfigError(
                f"pictures of {model.width} x {model.rows}",
                where="the camera's calibration",
                expected=f"{WIDTH} x {ROWS} for the detector as coded",
                remedy="choose another --detector",
            )
        self._hog = Hog(*SIZE)
        self._net, self._threshold = LaneNet.load(), threshold
        self.state: tuple[float, ...] = (0.5 * LANE_WIDTH, -0.5 * LANE_WIDTH)  # y (m) of left and right line

    def detect(self, view: CameraView) -> LaneLines:
        """Return the lines in `view.picture`; without any edge, the last ones."""
        part = np.ascontiguousarray(view.picture[PART])
        points = self._points(part)
        return self._kept(_columns_of_lines(points) if points.size else None)

    def _kept(self, columns: Sequence[float] | None) -> LaneLines:
        if columns:
            left, right = columns
            self.state = metres(left + INWARD), metres(right - INWARD)
        left, right = (RoadLine(y=y) for y in self.state)
        return LaneLines(left=left, right=right, path=RoadLine(y=0.0))

    def _points(self, part: np.ndarray) -> np.ndarray:
        """(row, column) in the picture of edges in windows with a mark; an edge in several windows is
        repeated."""
        edges = edges_in_windows(part)
        looked_at = np.flatnonzero(edges.sum(axis=(1, 2)) >= LEAST_EDGES)
        if not looked_at.size:
            return np.empty((0, 2), np.intp)
        found = windows(self._hog.blocks(part))[np.divmod(looked_at, WINDOWS[1])]
        marked = looked_at[self._net.score(found.reshape(-1, FEATURES)) > self._threshold]
        which, row, column = edges[marked].nonzero()
        down, across = np.divmod(marked[which], WINDOWS[1])
        return np.column_stack((FIRST_ROW + STRIDE * down + row, FIRST_COLUMN + STRIDE * across + column))


def edges_in_windows(part: np.ndarray) -> np.ndarray:
    """Mark edge pixels (windows, 32, 32) in each window of the part: vertical crests of the gradient that are
    steep for their window, however faint."""
    gradient = cv2.Sobel(part, cv2.CV_16S, 0, 1).astype(np.int32)
    power = gradient * gradient
    crest = np.zeros_like(power)
    above, here, below = power[:-2], power[1:-1], power[2:]
    np.multiply(here, (above <= here) & (here > below), out=crest[1:-1])
    down, across = (size // STRIDE for size in part.shape)
    tiles = power.reshape(down, STRIDE, across, STRIDE).sum(axis=(1, 3))
    sums = tiles[:-1, :-1] + tiles[1:, :-1] + tiles[:-1, 1:] + tiles[1:, 1:]
    # Powers are integers, so comparing with the limit's integer part is enough.
    limits = np.floor(STEEP / WINDOW**2 * sums).astype(np.int32)
    of_windows = np.lib.stride_tricks.sliding_window_view(crest, (WINDOW, WINDOW))[::STRIDE, ::STRIDE]
    return (of_windows > limits[:, :, np.newaxis, np.newaxis]).reshape(-1, WINDOW, WINDOW)


def _columns_of_lines(points: np.ndarray) -> tuple[float, float]:
    """Columns in which the clusters of `points` (row, column) next to the middle, left and right, cross the
    row where lines are read."""
    places, counts = np.unique(points[:, 0] * WIDTH + points[:, 1], return_counts=True)
    pixels = np.column_stack(np.divmod(places, WIDTH))
    labels = _linked(pixels, _radius(points))
    size = np.bincount(labels, counts)
    mean = np.bincount(labels, counts * pixels[:, 1]) / size
    large = size >= LEAST_POINTS
    columns = []
    for beside, sign in ((large & (mean < MIDDLE), 1.0), (large & (mean > MIDDLE), -1.0)):
        if beside.any():
            nearest = np.where(beside, sign * mean, -np.inf).argmax()
            columns.append(_crossing(pixels[labels == nearest], counts[labels == nearest]))
        else:
            columns.append(MISSING)
    return columns[0], columns[1]


def _radius(points: np.ndarray) -> float:
    down, across = (points.max(axis=0) - points.min(axis=0)).tolist()
    return sqrt(down * across * NEIGHBOURS / (len(points) * pi))


def _linked(pixels: np.ndarray, radius: float) -> np.ndarray:
    """Cluster of each pixel: pixels are linked if they are not further apart than the radius."""
    one, other = cKDTree(pixels).query_pairs(radius, output_type="ndarray").T
    order, ends = np.argsort(one, kind="stable"), np.bincount(one, minlength=len(pixels)).cumsum()
    links = np.ones(len(one)), other[order], np.concatenate(([0], ends))
    return connected_components(csr_array(links, shape=(len(pixels),) * 2), directed=False)[1]


def _crossing(pixels: np.ndarray, counts: np.ndarray) -> float:
    row, column = pixels.T.astype(float)
    weight = counts / counts.sum()
    mean_row, mean_column = dot(weight, row), dot(weight, column)
    down = row - mean_row
    power = dot(weight * down, down)
    slope = dot(weight * down, column) / power if power else 0.0
    return mean_column + slope * (ROW - mean_row)


def metres(column: float) -> float:
    """Lateral position (m, left positive) of the road in this column of row ROW."""
    return (MIDDLE - column) * METRES_PER_PIXEL
