"""Measure how often the geometric detector misses a line in bad weather: `python benchmarks/missed.py`.

Three cameras see rendered roads of all kinds through the strongest rain, snow and occlusion of the paper. A
frame counts as missed if a line is not found, or is off by more than 0.3 m at 10 m ahead. Roads on which a
line is missed in clear weather are left out.
"""

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.messages import CameraView  # noqa: E402
from selfdrive.sim.effects import PaperOcclusion, PaperRain, PaperSnow  # noqa: E402
from selfdrive.sim.effects.effect import Effect, Moment  # noqa: E402
from selfdrive.sim.picture import Picture  # noqa: E402
from selfdrive.sim.road_renderer import RoadRenderer  # noqa: E402
from selfdrive.visiond.robust_detector import RobustDetector  # noqa: E402
from selfdrive.visiond_lab.evaluate_on_real_frames import TUSIMPLE_MODEL, UDACITY_MODEL  # noqa: E402
from selfdrive.visiond_lab.random_looks import random_look  # noqa: E402

CAMERAS = CameraModel(), UDACITY_MODEL, TUSIMPLE_MODEL
EFFECTS: tuple[type[Effect], ...] = PaperRain, PaperSnow, PaperOcclusion
AHEAD, ERROR = 10.0, 0.3  # m
ROAD_SEED = 11


def is_found(
    model: CameraModel, picture: np.ndarray | Picture, truth: tuple[tuple[float, float], ...]
) -> bool:
    lines = RobustDetector(model).detect(CameraView(0.0, 0.0, 0.0, (), 0.0, np.asarray(picture)))
    return all(
        line.prob > 0.0 and abs(line.y - y + (line.slope - slope) * AHEAD) <= ERROR
        for line, (y, slope) in zip((lines.left, lines.right), truth, strict=True)
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0] + ".")
    parser.add_argument("--roads", type=int, default=60, help="roads for each camera (60)")
    parser.add_argument("--seeds", type=int, default=5, help="pictures of each road and effect (5)")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rng, moment = np.random.default_rng(ROAD_SEED), Moment(2.0, 50.0, 26.82)
    missed, roads, unfit = dict.fromkeys(EFFECTS, 0), 0, 0
    for model in CAMERAS:
        for number in range(options.roads):
            road = RoadRenderer(model, random_look(rng), number, periods=4)
            pose = rng.normal(0.0, 0.3), rng.normal(0.0, 0.01)
            clean, truth = road.render_grey(rng.uniform(0.0, 40.0), *pose), road.true_lines(*pose)
            if not is_found(model, clean, truth):
                unfit += 1
                continue
            roads += 1
            for kind in EFFECTS:
                for seed in range(1, options.seeds + 1):
                    missed[kind] += not is_found(model, kind(10, seed, model).apply(clean, moment), truth)
    pictures = options.seeds * roads
    print(f"{roads} roads; {unfit} more are left out, because a line is missed in fair weather")
    for kind, count in missed.items():
        print(f"{kind.__name__:<16} missed {count:>5} of {pictures}  {count / pictures:6.1%}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
