"""The paper's lane detector, which examines each picture independently.

It finds windows with a lane mark (HOG and a net with ten hidden nodes), Sobel edges inside them, and clusters
of edges (DBSCAN); straight lines are fitted to the clusters next to the car's middle.
"""

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond.dbscan import dbscan
from selfdrive.visiond.detector import LANE_WIDTH, LaneLines, RoadLine, path_between
from selfdrive.visiond.edge_lines import EdgeLines
from selfdrive.visiond.hog import FEATURES, Hog, windows
from selfdrive.visiond.lane_net import LaneNet
from selfdrive.visiond.mark_edges import edges, tile_numbers, tiles_with_mark, windows_on
from selfdrive.visiond.road_region import RoadRegion

EPS, MIN_SAMPLES = 4, 8  # pixels, edge pixels
THRESHOLD = 0.0  # log odds above which a window has a mark
NEED = 2  # marked windows among the four that share a tile


class PaperDetector:
    """Examines pictures of one camera, without memory.

    `calculated_by` identifies the compiled code in use, if any.
    """

    calculated_by = ""
    state: tuple[float, ...] = ()  # no memory

    def __init__(self, model: CameraModel) -> None:
        self._region = RoadRegion(model)
        self._hog = Hog(*self._region.shape)
        self._net = LaneNet.load()
        self._tile = tile_numbers(*self._region.shape)
        self._lines = EdgeLines(model, self._region)

    def detect(self, view: CameraView) -> LaneLines:
        """Return the lines in `view.picture`; a line not seen has prob 0 and the expected position."""
        part = np.ascontiguousarray(view.picture[self._region.part])
        at, rising = edges(part)
        tile = self._tile.take(at)
        inside = tiles_with_mark(self._marked(part, tile), NEED).take(tile)
        at, rising = at[inside], rising[inside]
        labels = dbscan(at, part.shape, EPS, MIN_SAMPLES)
        return lane_between(*self._lines.nearest(at, rising, labels))

    def _marked(self, part: np.ndarray, tile: np.ndarray) -> np.ndarray:
        looked_at = self._region.windows
        tiles = np.zeros((looked_at.shape[0] + 1, looked_at.shape[1] + 1), bool)
        tiles.ravel()[tile] = True
        marked = looked_at & windows_on(tiles)
        row, column = marked.nonzero()
        if row.size:
            found = windows(self._hog.blocks(part))[row, column]
            score = self._net.score(found.reshape(-1, FEATURES))
            marked[row, column] = score > THRESHOLD
        return marked


def lane_between(left: RoadLine | None, right: RoadLine | None) -> LaneLines:
    left = left or RoadLine(y=0.5 * LANE_WIDTH, prob=0.0)
    right = right or RoadLine(y=-0.5 * LANE_WIDTH, prob=0.0)
    return LaneLines(left=left, right=right, path=path_between(left, right))
