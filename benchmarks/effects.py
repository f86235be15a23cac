"""Measure the median time per frame of each image effect.

`python benchmarks/effects.py [EFFECT ...] [--repeat N] [--plain]`. It measures mild and strong effects on one
core, with the default camera. It uses compiled code unless given `--plain`. Times are CPU times of this
process. The exit code is 1 if a median is above 3 ms.
"""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from time import process_time
from typing import NamedTuple

import cv2

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common import compiled  # noqa: E402
from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER  # noqa: E402
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT  # noqa: E402
from selfdrive.sim.road_renderer import RoadRenderer  # noqa: E402

GOAL = 3.0  # ms a frame


class Moment(NamedTuple):
    t: float
    position: float
    v_ego: float


def milliseconds(work: Callable[[], object]) -> float:
    start = process_time()
    work()
    return 1000.0 * (process_time() - start)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("effects", nargs="*", help="names of effects; all of them if none is given")
    parser.add_argument("--repeat", type=int, default=100, help="pictures for each median")
    parser.add_argument("--plain", action="store_true", help="without compiled code")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    compiled.use_libraries_in(None if given.plain else COMPILED_FOLDER)
    camera = CameraModel()
    picture = RoadRenderer(camera, "solid", 0).render_grey(10.0)
    slow = []
    print(f"{'effect':<16}{'amount':>8}{'made in':>12}{'median':>12}{'fastest':>12}{'of the goal':>13}  in")
    for kind, amounts in AMOUNTS_BY_EFFECT.items():
        if given.effects and kind.__name__ not in given.effects:
            continue
        for amount in (amounts[0], amounts[-1]):
            start = process_time()
            effect = kind(amount, 1, camera).ready()
            made = 1000.0 * (process_time() - start)
            moments = [Moment(2.0 + 0.05 * k, 50.0 + 1.341 * k, 26.82) for k in range(given.repeat)]
            times = [milliseconds(partial(effect.apply, picture, moment)) for moment in moments]
            language = "C" if effect._key[-1] else "Python"
            print(
                f"{kind.__name__:<16}{amount:>8g}{made:>9.1f} ms{median(times):>9.2f} ms{min(times):>9.2f} ms"
                f"{median(times) / GOAL:>13.2f}  {language}"
            )
            if median(times) > GOAL:
                slow.append(kind.__name__)
    if slow:
        print(f"above {GOAL:g} ms: {', '.join(slow)}")
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
