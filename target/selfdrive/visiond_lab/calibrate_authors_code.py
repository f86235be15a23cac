"""Finds the threshold of the detector as coded: `python -m selfdrive.visiond_lab.calibrate_authors_code`.

Considers thresholds that mistake at most MOST_MISTAKEN_SHARE of the windows inside the lane for marks. Of
those that misplace a line by more than MOST_LINE_ERROR in the fewest pictures, the middle one is printed. All
pictures are clean.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.road_look import SOLID
from selfdrive.sim.road_renderer import RoadRenderer
from selfdrive.visiond import authors_code_detector as coded
from selfdrive.visiond.hog import WINDOW_FEATURES, WINDOW_PIXELS, WINDOW_STRIDE, Hog, detection_windows
from selfdrive.visiond.lane_net import AUTHORS_CODE_NET, LaneNet

MOST_MISTAKEN_SHARE = 0.003  # of the windows inside the lane
MOST_LINE_ERROR = 0.3  # m
TRIED_THRESHOLDS = [0.25 * k for k in range(33)]  # log odds
SEED, PICTURE_COUNT = 0, 200
OFFSET_SIGMA = 0.2  # m, standard deviation of the car's position
MIN_DISTANCE_FROM_LINE = 0.3  # m; a nearer window can show part of the line


def evaluate_thresholds() -> list[tuple[float, float, float]]:
    """Threshold, share of windows inside the lane classified as marks, share of pictures with a line off."""
    rng = np.random.default_rng(SEED)
    road = RoadRenderer(CameraModel(), SOLID, int(rng.integers(2**31)), periods=66)
    offsets = rng.normal(0.0, OFFSET_SIGMA, PICTURE_COUNT).tolist()
    pictures = [road.render_grey(805.2 * k / PICTURE_COUNT, offset) for k, offset in enumerate(offsets)]
    scores = np.concatenate(
        [_scores_inside_lane(road, *pair) for pair in zip(pictures, offsets, strict=True)]
    )
    return [
        (threshold, float((scores > threshold).mean()), _misplaced_share(road, threshold, pictures, offsets))
        for threshold in TRIED_THRESHOLDS
    ]


def _scores_inside_lane(road: RoadRenderer, picture: np.ndarray, offset: float) -> np.ndarray:
    model = road.model
    part = np.ascontiguousarray(picture[coded.WINDOWS_PART])
    scores = LaneNet.load(AUTHORS_CODE_NET).log_odds(
        detection_windows(Hog(*part.shape).blocks(part)).reshape(-1, WINDOW_FEATURES)
    )
    inside = np.zeros(coded.WINDOW_COUNTS, bool)
    for down, across in np.ndindex(*coded.WINDOW_COUNTS):
        top, first = coded.FIRST_ROW + WINDOW_STRIDE * down, coded.FIRST_COLUMN + WINDOW_STRIDE * across
        rows = np.array([top, top + WINDOW_PIXELS])
        margin = MIN_DISTANCE_FROM_LINE / np.array([model.metres_per_pixel(row) for row in rows])
        left, right = (
            a * rows + b for a, b in (model.line_in_picture(*line) for line in road.true_lines(offset))
        )
        inside[down, across] = (left + margin < first).all() and (
            right - margin > first + WINDOW_PIXELS
        ).all()
    return scores[inside.ravel()]


def _misplaced_share(
    road: RoadRenderer, threshold: float, pictures: Sequence[np.ndarray], offsets: Sequence[float]
) -> float:
    detector, off = coded.AuthorsCodeDetector(road.model, threshold), 0
    for picture, offset in zip(pictures, offsets, strict=True):
        ideal_view = {"left_lane_y": 0.0, "right_lane_y": 0.0, "path_y": 0.0, "bend": (), "lead_d_rel": 0.0}
        detected = detector.detect(CameraView(**ideal_view, picture=picture))
        true_columns = [
            a * coded.LINE_READ_ROW + b
            for a, b in (road.model.line_in_picture(*x) for x in road.true_lines(offset))
        ]
        true_positions = (
            coded.lateral_position(true_columns[0] + coded.INWARD_PIXELS),
            coded.lateral_position(true_columns[1] - coded.INWARD_PIXELS),
        )
        off += (
            abs(detected.left.y - true_positions[0]) > MOST_LINE_ERROR
            or abs(detected.right.y - true_positions[1]) > MOST_LINE_ERROR
        )
    return off / len(pictures)


def main() -> None:
    cv2.setNumThreads(1)
    evaluated = evaluate_thresholds()
    for threshold, marked, off in evaluated:
        shares = f"{marked:.2%} of the windows inside the lane marked, {off:.1%} of the pictures off"
        print(f"{threshold:5.2f}: {shares}")
    fewest = min(off for _, marked, off in evaluated if marked <= MOST_MISTAKEN_SHARE)
    acceptable = [
        threshold for threshold, marked, off in evaluated if marked <= MOST_MISTAKEN_SHARE and off == fewest
    ]
    print(f"{acceptable[len(acceptable) // 2]:.2f}")


if __name__ == "__main__":
    main()
