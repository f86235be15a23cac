"""The paper's lane detector: gradients, a neural net, edges and clusters, each picture for itself.

Windows with a lane mark (HOG and a net with one hidden layer of ten), Sobel edges inside them, DBSCAN on the
edges; the clusters next to the car's middle, left and right, are the lane's lines, fitted by straight ones.
"""

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond.dbscan import dbscan
from selfdrive.visiond.detector import LANE_WIDTH, LaneLines, RoadLine, path_between
from selfdrive.visiond.edge_lines import EdgeLines
from selfdrive.visiond.hog import FEATURES, Hog, windows
from selfdrive.visiond.lane_net import LaneNet
from selfdrive.visiond.mark_edges import edges, tiles_with_mark
from selfdrive.visiond.road_region import RoadRegion

EPS, MIN_SAMPLES = 4, 8  # pixels, edge pixels
STACK = 8  # windows that the net looks at in one multiplication
NEED = 2  # marked windows of the four that share a tile


class PaperDetector:
    """Looks at pictures of one camera; remembers none of them."""

    state: tuple[float, ...] = ()  # nothing is remembered

    def __init__(self, model: CameraModel) -> None:
        self._region = RoadRegion(model)
        self._hog = Hog(*self._region.shape)
        self._net = LaneNet.load()
        self._looked_at = _stacked(self._region.windows)
        self._lines = EdgeLines(model, self._region)

    def detect(self, view: CameraView) -> LaneLines:
        """The lines in `view.picture`. One that is not seen has prob 0, and is where a lane's would be."""
        part = np.ascontiguousarray(view.picture[self._region.part])
        mask, rising = edges(part, tiles_with_mark(self._marked(part), NEED))
        left, right = self._lines.nearest(mask, rising, dbscan(mask, EPS, MIN_SAMPLES))
        left = left or RoadLine(y=0.5 * LANE_WIDTH, prob=0.0)
        right = right or RoadLine(y=-0.5 * LANE_WIDTH, prob=0.0)
        return LaneLines(left=left, right=right, path=path_between(left, right))

    def _marked(self, part: np.ndarray) -> np.ndarray:
        """Which windows (rows x columns, bool) hold a lane mark."""
        found = windows(self._hog.blocks(part))
        features = found[self._looked_at].reshape(-1, STACK, FEATURES)
        marked = np.zeros(found.shape[:2], bool)
        marked[self._looked_at] = self._net.score(features).ravel() > 0.0
        return marked


def _stacked(looked_at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the windows looked at, the last repeated to fill the last stack."""
    row, column = np.nonzero(looked_at)
    spare = -row.size % STACK
    return np.pad(row, (0, spare), mode="edge"), np.pad(column, (0, spare), mode="edge")
