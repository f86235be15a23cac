"""Finds the threshold of the detector as coded: `python -m selfdrive.visiond.coded_threshold`.

It is the least at which, on clean pictures of the road without a fault, no more than ALLOWED of the windows
inside the lane are taken for some with a mark. Nothing else is looked at: no effect, no run, no hazard.
"""

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.road_look import DASHED, SOLID
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond import coded_detector as coded
from selfdrive.visiond.hog import FEATURES, STRIDE, WINDOW, Hog, windows
from selfdrive.visiond.lane_net import LaneNet

ALLOWED = 0.003
SEED, PICTURES = 0, 300  # of each road
OFFSET, HEADING = 0.3, 0.01  # m, rad: standard deviations of how the car stands
BESIDE = 0.3  # m: a window nearer to a line than this may show some of it


def threshold() -> tuple[float, int]:
    """The threshold (log odds), and how many windows it was found with."""
    chance, net, scores = np.random.default_rng(SEED), LaneNet.load(), []
    for marks in (SOLID, DASHED):
        road = RoadRenderer(CameraModel(), marks, int(chance.integers(2**31)), periods=66)
        for _ in range(PICTURES):
            pose = chance.uniform(0.0, 800.0), chance.normal(0.0, OFFSET), chance.normal(0.0, HEADING)
            part = np.ascontiguousarray(road.grey(*pose)[coded.PART])
            blocks = windows(Hog(*part.shape).blocks(part)).reshape(-1, FEATURES)
            scores.append(net.score(blocks[_inside(road, *pose[1:])]))
    found = np.sort(np.concatenate(scores))
    return float(found[int((1.0 - ALLOWED) * found.size)]), found.size


def _inside(road: RoadRenderer, offset: float, heading: float) -> np.ndarray:
    """Which windows lie wholly between the lane's lines."""
    model = road.model
    left, right = (model.line_in_picture(*line) for line in road.truth(offset, heading))
    inside = np.zeros(coded.WINDOWS, bool)
    for down, across in np.ndindex(*coded.WINDOWS):
        rows = coded.FIRST_ROW + STRIDE * down + np.array([0, WINDOW])
        first, last = coded.FIRST_COLUMN + STRIDE * across + np.array([0, WINDOW])
        margin = BESIDE / np.array([model.metres_per_pixel(row) for row in rows])
        after_left = (left[0] * rows + left[1] + margin < first).all()
        inside[down, across] = after_left and (right[0] * rows + right[1] - margin > last).all()
    return inside.ravel()


if __name__ == "__main__":
    cv2.setNumThreads(1)
    print("{:.3f}, of {} windows".format(*threshold()))
