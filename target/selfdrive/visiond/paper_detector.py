"""The paper's lane detector, which examines each picture independently.

It finds windows with a lane mark (HOG and a net with ten hidden nodes), Sobel edges inside them, and clusters
of edges (DBSCAN); straight lines are fitted to the clusters next to the car's middle.
"""

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.visiond.dbscan import dbscan
from selfdrive.visiond.detector import LANE_WIDTH, LaneLines, RoadLine, path_between
from selfdrive.visiond.edge_lines import EdgeLines, FittedLine, line_evidence
from selfdrive.visiond.hog import WINDOW_FEATURES, Hog, detection_windows
from selfdrive.visiond.lane_net import PAPER_NET, LaneNet
from selfdrive.visiond.line_confidence import MIN_CONFIDENT, PAPER_CONFIDENCE, LineConfidence
from selfdrive.visiond.mark_edges import find_steep_edges, tile_numbers, tiles_with_mark, windows_on_tiles
from selfdrive.visiond.road_region import RoadRegion

CLUSTER_REACH, MIN_CLUSTER_EDGES = 4, 8  # pixels, edge pixels
MIN_LOG_ODDS = 0.0  # log odds above which a window has a mark
MIN_MARKED_WINDOWS = 2  # marked windows among the four that share a tile


class PaperDetector:
    """Examines pictures of one camera, without memory.

    `calculated_by` identifies the compiled code in use, if any.
    """

    calculated_by = ""
    state: tuple[float, ...] = ()  # no memory

    def __init__(self, model: CameraModel) -> None:
        self._region = RoadRegion(model)
        self._hog = Hog(*self._region.shape)
        self._net = LaneNet.load(PAPER_NET)
        self._confidence = LineConfidence.load(PAPER_CONFIDENCE)
        self._tile = tile_numbers(*self._region.shape)
        self._lines = EdgeLines(model, self._region)

    def detect(self, view: CameraView) -> LaneLines:
        """Return the lines in `view.picture`; a line not seen has prob 0 and the expected position."""
        return complete_lane(*self.fit_lines(view), self._confidence)

    def fit_lines(self, view: CameraView) -> tuple[FittedLine | None, FittedLine | None]:
        """The left and the right line in `view.picture`, None for a line not seen."""
        part = np.ascontiguousarray(view.picture[self._region.part])
        at, rising = find_steep_edges(part)
        tile = self._tile.take(at)
        inside = tiles_with_mark(self._windows_with_mark(part, tile), MIN_MARKED_WINDOWS).take(tile)
        at, rising = at[inside], rising[inside]
        labels = dbscan(at, part.shape, CLUSTER_REACH, MIN_CLUSTER_EDGES)
        return self._lines.nearest_lines(at, rising, labels)

    def _windows_with_mark(self, part: np.ndarray, tile: np.ndarray) -> np.ndarray:
        candidates = self._region.windows
        tiles = np.zeros((candidates.shape[0] + 1, candidates.shape[1] + 1), bool)
        tiles.ravel()[tile] = True
        marked = candidates & windows_on_tiles(tiles)
        row, column = marked.nonzero()
        if row.size:
            features = detection_windows(self._hog.blocks(part))[row, column]
            score = self._net.log_odds(features.reshape(-1, WINDOW_FEATURES))
            marked[row, column] = score > MIN_LOG_ODDS
        return marked


def complete_lane(left: FittedLine | None, right: FittedLine | None, confidence: LineConfidence) -> LaneLines:
    """The lines with their probabilities, and the path, which is led only by lines that are likely right."""
    lines = _road_line(left, 1.0, right, confidence), _road_line(right, -1.0, left, confidence)
    leading = (line if line.prob >= MIN_CONFIDENT else line._replace(prob=0.0) for line in lines)
    return LaneLines(*lines, path=path_between(*leading))


def _road_line(
    line: FittedLine | None, side: float, other: FittedLine | None, confidence: LineConfidence
) -> RoadLine:
    if line is None:
        return RoadLine(y=side * 0.5 * LANE_WIDTH, prob=0.0)
    prob = confidence.probability(line_evidence(line, side, other))
    return RoadLine(y=line.y, slope=line.slope, prob=prob)
