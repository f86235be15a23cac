"""Finds the threshold of the detector as coded: `python -m selfdrive.visiond_lab.calibrate_as_coded`.

Considers thresholds that mistake at most ALLOWED of the windows inside the lane for marks. Of those that
misplace a line by more than OFF in the fewest pictures, the middle one is printed. All pictures are clean.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.road_look import SOLID
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond import coded_detector as coded
from selfdrive.visiond.hog import FEATURES, STRIDE, WINDOW, Hog, windows
from selfdrive.visiond.lane_net import LaneNet

ALLOWED = 0.003
OFF = 0.3  # m
TRIED = [0.25 * k for k in range(33)]  # log odds
SEED, PICTURES = 0, 200
OFFSET = 0.2  # m, standard deviation of the car's position
BESIDE = 0.3  # m; a nearer window can show part of the line


def thresholds() -> list[tuple[float, float, float]]:
    """Threshold, share of windows inside the lane classified as marks, share of pictures with a line off."""
    chance = np.random.default_rng(SEED)
    road = RoadRenderer(CameraModel(), SOLID, int(chance.integers(2**31)), periods=66)
    offsets = chance.normal(0.0, OFFSET, PICTURES).tolist()
    pictures = [road.grey(805.2 * k / PICTURES, offset) for k, offset in enumerate(offsets)]
    scores = np.concatenate([_inside(road, *one) for one in zip(pictures, offsets, strict=True)])
    return [(one, float((scores > one).mean()), _off(road, one, pictures, offsets)) for one in TRIED]


def _inside(road: RoadRenderer, picture: np.ndarray, offset: float) -> np.ndarray:
    model = road.model
    part = np.ascontiguousarray(picture[coded.PART])
    scores = LaneNet.load().score(windows(Hog(*part.shape).blocks(part)).reshape(-1, FEATURES))
    inside = np.zeros(coded.WINDOWS, bool)
    for down, across in np.ndindex(*coded.WINDOWS):
        top, first = coded.FIRST_ROW + STRIDE * down, coded.FIRST_COLUMN + STRIDE * across
        rows = np.array([top, top + WINDOW])
        margin = BESIDE / np.array([model.metres_per_pixel(row) for row in rows])
        left, right = (a * rows + b for a, b in (model.line_in_picture(*line) for line in road.truth(offset)))
        inside[down, across] = (left + margin < first).all() and (right - margin > first + WINDOW).all()
    return scores[inside.ravel()]


def _off(
    road: RoadRenderer, threshold: float, pictures: Sequence[np.ndarray], offsets: Sequence[float]
) -> float:
    detector, off = coded.CodedDetector(road.model, threshold), 0
    for picture, offset in zip(pictures, offsets, strict=True):
        there = {"left_lane_y": 0.0, "right_lane_y": 0.0, "path_y": 0.0, "bend": (), "lead_d_rel": 0.0}
        seen = detector.detect(CameraView(**there, picture=picture))
        true = [a * coded.ROW + b for a, b in (road.model.line_in_picture(*x) for x in road.truth(offset))]
        read = coded.metres(true[0] + coded.INWARD), coded.metres(true[1] - coded.INWARD)
        off += abs(seen.left.y - read[0]) > OFF or abs(seen.right.y - read[1]) > OFF
    return off / len(pictures)


def main() -> None:
    cv2.setNumThreads(1)
    found = thresholds()
    for threshold, marked, off in found:
        shares = f"{marked:.2%} of the windows inside the lane marked, {off:.1%} of the pictures off"
        print(f"{threshold:5.2f}: {shares}")
    fewest = min(off for _, marked, off in found if marked <= ALLOWED)
    will_do = [threshold for threshold, marked, off in found if marked <= ALLOWED and off == fewest]
    print(f"{will_do[len(will_do) // 2]:.2f}")


if __name__ == "__main__":
    main()
