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
from selfdrive.visiond.hog import Hog, windows
from selfdrive.visiond.lane_net import LaneNet
from selfdrive.visiond.mark_edges import edges, tiles_with_mark
from selfdrive.visiond.road_region import RoadRegion

EPS, MIN_SAMPLES = 4, 8  # pixels, edge pixels
NEED = 2  # marked windows of the four that share a tile


class PaperDetector:
    """Looks at pictures of one camera; remembers none of them."""

    def __init__(self, model: CameraModel) -> None:
        self._region = RoadRegion(model)
        self._hog = Hog(*self._region.shape)
        self._net = LaneNet.load()
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
        looked_at = self._region.windows
        features = windows(self._hog.blocks(part))[looked_at]
        marked = np.zeros(looked_at.shape, bool)
        marked[looked_at] = self._net.score(features.reshape(len(features), -1)) > 0.0
        return marked
