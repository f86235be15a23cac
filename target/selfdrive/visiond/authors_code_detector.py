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
from selfdrive.visiond.hog import WINDOW_FEATURES, WINDOW_PIXELS, WINDOW_STRIDE, Hog, detection_windows
from selfdrive.visiond.lane_net import AUTHORS_CODE_NET, LaneNet

PICTURE_WIDTH, PICTURE_ROWS = 640, 480  # px, the size of pictures for all positions below
FIRST_ROW, FIRST_COLUMN = 235, 90  # of the windows
WINDOW_COUNTS = 6, 29  # down, across
# px of the part of the picture that they cover
WINDOWS_PART_SIZE = tuple((count - 1) * WINDOW_STRIDE + WINDOW_PIXELS for count in WINDOW_COUNTS)
WINDOWS_PART = (
    slice(FIRST_ROW, FIRST_ROW + WINDOWS_PART_SIZE[0]),
    slice(FIRST_COLUMN, FIRST_COLUMN + WINDOWS_PART_SIZE[1]),
)
MIN_LOG_ODDS = 4.0  # lowest log odds of a window with a mark; see visiond_lab.calibrate_authors_code
MIN_EDGE_STEEPNESS = 4.0  # an edge's squared gradient, as a multiple of the window's mean
MIN_WINDOW_EDGES = 25  # px, in a window that is used
POINTS_IN_RADIUS = 5  # points within the clusters' radius if all were evenly spread
MIN_CLUSTER_POINTS = 30  # of a cluster
MIDDLE_COLUMN = 320  # column that separates left and right lines
LINE_READ_ROW = 278  # where lines are read
INWARD_PIXELS = 3  # px by which a line is read closer to the middle
METRES_PER_PIXEL = 0.024856  # in LINE_READ_ROW, from the code of the paper's authors
MISSING_LINE_COLUMN = 0  # column of a line without a cluster


class AuthorsCodeDetector:
    """Examines pictures of 640 x 480 pixels and remembers where it last saw the lines.

    Its lines and path have probability 1 and are parallel to the car. `calculated_by` identifies the compiled
    code in use, if any. Raises ConfigError for a camera with pictures of another size.
    """

    calculated_by = ""

    def __init__(self, model: CameraModel, threshold: float = MIN_LOG_ODDS) -> None:
        if (model.width, model.rows) != (PICTURE_WIDTH, PICTURE_ROWS):
            raise ConfigError(
                f"pictures of {model.width} x {model.rows}",
                where="the camera's calibration",
                expected=f"{PICTURE_WIDTH} x {PICTURE_ROWS} for the detector as coded",
                remedy="choose another --detector",
            )
        self._hog = Hog(*WINDOWS_PART_SIZE)
        self._net, self._threshold = LaneNet.load(AUTHORS_CODE_NET), threshold
        self.state: tuple[float, ...] = (0.5 * LANE_WIDTH, -0.5 * LANE_WIDTH)  # y (m) of left and right line

    def detect(self, view: CameraView) -> LaneLines:
        """Return the lines in `view.picture`; without any edge, the last ones."""
        part = np.ascontiguousarray(view.picture[WINDOWS_PART])
        points = self._edge_points(part)
        return self._remember(_columns_of_lines(points) if points.size else None)

    def _remember(self, columns: Sequence[float] | None) -> LaneLines:
        if columns:
            left, right = columns
            self.state = lateral_position(left + INWARD_PIXELS), lateral_position(right - INWARD_PIXELS)
        left, right = (RoadLine(y=y) for y in self.state)
        return LaneLines(left=left, right=right, path=RoadLine(y=0.0))

    def _edge_points(self, part: np.ndarray) -> np.ndarray:
        """(row, column) in the picture of edges in windows with a mark; an edge in several windows is
        repeated."""
        edges = edges_in_windows(part)
        candidates = np.flatnonzero(edges.sum(axis=(1, 2)) >= MIN_WINDOW_EDGES)
        if not candidates.size:
            return np.empty((0, 2), np.intp)
        features = detection_windows(self._hog.blocks(part))[np.divmod(candidates, WINDOW_COUNTS[1])]
        with_mark = candidates[self._net.log_odds(features.reshape(-1, WINDOW_FEATURES)) > self._threshold]
        window, row, column = edges[with_mark].nonzero()
        down, across = np.divmod(with_mark[window], WINDOW_COUNTS[1])
        return np.column_stack(
            (FIRST_ROW + WINDOW_STRIDE * down + row, FIRST_COLUMN + WINDOW_STRIDE * across + column)
        )


def edges_in_windows(part: np.ndarray) -> np.ndarray:
    """Mark edge pixels (windows, 32, 32) in each window of the part: vertical crests of the gradient that are
    steep for their window, however faint."""
    gradient = cv2.Sobel(part, cv2.CV_16S, 0, 1).astype(np.int32)
    power = gradient * gradient
    crest = np.zeros_like(power)
    above, here, below = power[:-2], power[1:-1], power[2:]
    np.multiply(here, (above <= here) & (here > below), out=crest[1:-1])
    down, across = (size // WINDOW_STRIDE for size in part.shape)
    tiles = power.reshape(down, WINDOW_STRIDE, across, WINDOW_STRIDE).sum(axis=(1, 3))
    sums = tiles[:-1, :-1] + tiles[1:, :-1] + tiles[:-1, 1:] + tiles[1:, 1:]
    # Powers are integers, so comparing with the limit's integer part is enough.
    limits = np.floor(MIN_EDGE_STEEPNESS / WINDOW_PIXELS**2 * sums).astype(np.int32)
    of_windows = np.lib.stride_tricks.sliding_window_view(crest, (WINDOW_PIXELS, WINDOW_PIXELS))[
        ::WINDOW_STRIDE, ::WINDOW_STRIDE
    ]
    return (of_windows > limits[:, :, np.newaxis, np.newaxis]).reshape(-1, WINDOW_PIXELS, WINDOW_PIXELS)


def _columns_of_lines(points: np.ndarray) -> tuple[float, float]:
    """Columns in which the clusters of `points` (row, column) next to the middle, left and right, cross the
    row where lines are read."""
    places, counts = np.unique(points[:, 0] * PICTURE_WIDTH + points[:, 1], return_counts=True)
    pixels = np.column_stack(np.divmod(places, PICTURE_WIDTH))
    labels = _link_pixels(pixels, _cluster_radius(points))
    size = np.bincount(labels, counts)
    mean = np.bincount(labels, counts * pixels[:, 1]) / size
    large = size >= MIN_CLUSTER_POINTS
    columns = []
    for beside, sign in ((large & (mean < MIDDLE_COLUMN), 1.0), (large & (mean > MIDDLE_COLUMN), -1.0)):
        if beside.any():
            nearest = np.where(beside, sign * mean, -np.inf).argmax()
            columns.append(_column_at_read_row(pixels[labels == nearest], counts[labels == nearest]))
        else:
            columns.append(MISSING_LINE_COLUMN)
    return columns[0], columns[1]


def _cluster_radius(points: np.ndarray) -> float:
    down, across = (points.max(axis=0) - points.min(axis=0)).tolist()
    return sqrt(down * across * POINTS_IN_RADIUS / (len(points) * pi))


def _link_pixels(pixels: np.ndarray, radius: float) -> np.ndarray:
    """Cluster of each pixel: pixels are linked if they are not further apart than the radius."""
    first, second = cKDTree(pixels).query_pairs(radius, output_type="ndarray").T
    order, ends = np.argsort(first, kind="stable"), np.bincount(first, minlength=len(pixels)).cumsum()
    links = np.ones(len(first)), second[order], np.concatenate(([0], ends))
    return connected_components(csr_array(links, shape=(len(pixels),) * 2), directed=False)[1]


def _column_at_read_row(pixels: np.ndarray, counts: np.ndarray) -> float:
    row, column = pixels.T.astype(float)
    weight = counts / counts.sum()
    mean_row, mean_column = dot(weight, row), dot(weight, column)
    down = row - mean_row
    power = dot(weight * down, down)
    slope = dot(weight * down, column) / power if power else 0.0
    return mean_column + slope * (LINE_READ_ROW - mean_row)


def lateral_position(column: float) -> float:
    """Lateral position (m, left positive) of the road in this column of row LINE_READ_ROW."""
    return (MIDDLE_COLUMN - column) * METRES_PER_PIXEL


def column_of(lateral_position: float) -> float:
    """Column of the road at this lateral position (m, left positive) in row LINE_READ_ROW."""
    return MIDDLE_COLUMN - lateral_position / METRES_PER_PIXEL
