"""Measure the median time per frame of the geometric and the as-coded detectors.

`python benchmarks/detect_drive.py [--repeat N] [--plain]`. It runs on one core, in clear and in bad weather,
with compiled code unless given `--plain`. Times are CPU times of this process.
"""

import argparse
import os
import sys
from pathlib import Path
from statistics import median
from time import process_time
from typing import NamedTuple

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # as in a campaign; numpy reads it when it is imported

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common import compiled  # noqa: E402
from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.messages import CameraView  # noqa: E402
from selfdrive.sim import effects  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER  # noqa: E402
from selfdrive.sim.road_renderer import RoadRenderer  # noqa: E402
from selfdrive.visiond.authors_code_detector import AuthorsCodeDetector  # noqa: E402
from selfdrive.visiond.compiled_authors_code import build_authors_code_detector  # noqa: E402
from selfdrive.visiond.compiled_robust import build_robust_detector  # noqa: E402
from selfdrive.visiond.robust_detector import RobustDetector  # noqa: E402

# weather, amount, goal for the median (ms)
ROBUST = ((None, 0.0, 2.5), ("PaperRain", 10.0, 4.0), ("PaperSnow", 10.0, 4.0), ("Rain", 100.0, 4.0))
CODED = ((None, 0.0, 3.0), ("CodedRain", 10, 3.0), ("CodedSnow", 10, 3.0), ("CodedOcclusion", 10, 3.0))
STEP = 1.342  # m between frames
DIFFERENT = 40  # different frames in a drive


class Moment(NamedTuple):
    t: float
    position: float
    v_ego: float


def drive(marks: str, weather: str | None, amount: float) -> list[np.ndarray]:
    """Return two seconds of frames."""
    camera = CameraModel()
    road = RoadRenderer(camera, marks, 0)
    pictures = [road.render_grey(STEP * k) for k in range(DIFFERENT)]
    if weather is None:
        return pictures
    effect = getattr(effects, weather)(amount, 1, camera)
    return [
        effect.apply(picture, Moment(2.0 + 0.05 * k, STEP * k, 26.82)).copy()
        for k, picture in enumerate(pictures)
    ]


def times(
    detector: RobustDetector | AuthorsCodeDetector, pictures: list[np.ndarray], repeat: int
) -> list[float]:
    """Return the CPU time (ms) of each detection. Only the first has no previous frame."""
    found = []
    for k in range(repeat):
        view = CameraView(
            left_lane_y=0.0,
            right_lane_y=0.0,
            path_y=0.0,
            bend=(),
            lead_d_rel=0.0,
            picture=pictures[k % DIFFERENT],
        )
        start = process_time()
        detector.detect(view)
        found.append(1000.0 * (process_time() - start))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeat", type=int, default=300, help="pictures for each median")
    parser.add_argument("--plain", action="store_true", help="without compiled code")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    compiled.use_libraries_in(None if options.plain else COMPILED_FOLDER)
    slow = False
    columns = "".join(f"{name:>10}" for name in ("first", "median", "slowest", "goal"))
    print(f"{'detector':<10}{'marks':<8}{'weather':<18}{columns}{'ratio':>8}  in")
    cases = [
        ("robust", build_robust_detector, marks, *case) for marks in ("solid", "dashed") for case in ROBUST
    ]
    cases += [("as_coded", build_authors_code_detector, "solid", *case) for case in CODED]
    for kind, build, marks, weather, amount, goal in cases:
        detector = build(CameraModel())
        found = times(detector, drive(marks, weather, amount), options.repeat)
        slow |= median(found) > goal
        name = f"{weather} {amount:g}" if weather else "clean"
        shown = (found[0], median(found), max(found[1:], default=found[0]), goal)
        figures = "".join(f"{value:7.2f} ms" for value in shown)
        language = "C" if detector.calculated_by else "Python"
        print(f"{kind:<10}{marks:<8}{name:<18}{figures}{median(found) / goal:8.2f}  {language}")
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
