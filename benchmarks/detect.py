"""Measure the CPU time of the paper's lane detector.

`python benchmarks/detect.py [--repeat N]`. It prints the median CPU time (ms, one thread) of a detection,
compiled and in Python, and of each step in Python. The frames show the rendered road, clean and with rain,
snow and noise. The last column divides the time of the compiled detection (if there is none, of that in
Python) by its goal.
"""

import argparse
import math
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common import compiled  # noqa: E402
from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.messages import CameraView  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER  # noqa: E402
from selfdrive.sim.effects import PaperRain, PaperSnow  # noqa: E402
from selfdrive.sim.road_renderer import RoadRenderer  # noqa: E402
from selfdrive.visiond.compiled_paper import build_paper_detector  # noqa: E402
from selfdrive.visiond.dbscan import dbscan  # noqa: E402
from selfdrive.visiond.edge_lines import EdgeLines  # noqa: E402
from selfdrive.visiond.hog import Hog  # noqa: E402
from selfdrive.visiond.mark_edges import find_steep_edges  # noqa: E402
from selfdrive.visiond.paper_detector import CLUSTER_REACH, MIN_CLUSTER_EDGES, PaperDetector  # noqa: E402
from selfdrive.visiond.road_region import RoadRegion  # noqa: E402

GOAL, FOUL_GOAL = 1.5, 4.0  # ms for a detection, in clear and in bad weather
COLUMNS = "compiled", "Python", "hog", "edges", "dbscan", "lines", "edge pixels", "of the goal"


def median_ms(work: Callable[[], object], repeat: int) -> float:
    times = []
    for _ in range(repeat):
        start = time.thread_time()
        work()
        times.append(time.thread_time() - start)
    return 1e3 * statistics.median(times)


def pictures(model: CameraModel) -> dict[str, np.ndarray]:
    clean = RoadRenderer(model, "solid", 0).render_grey(3.0)
    moment = SimpleNamespace(t=2.0, position=3.0, v_ego=26.8)
    found = {"clean": clean}
    for level in (1, 3, 5, 10):
        found[f"rain {level}"] = np.asarray(PaperRain(level, 1, model).apply(clean, moment))
    found["snow 10"] = np.asarray(PaperSnow(10, 1, model).apply(clean, moment))
    noise = np.random.default_rng(0).normal(0.0, 12.0, clean.shape)
    found["noise"] = np.clip(clean + noise, 0, 255).astype(np.uint8)
    return found


def measure(model: CameraModel, picture: np.ndarray, repeat: int) -> list[float]:
    """Return the median times (ms) of the compiled detection (NaN if there is none), of the detection in
    Python and of its steps, then the number of edge pixels.
    """
    fast, plain, region = build_paper_detector(model), PaperDetector(model), RoadRegion(model)
    view = CameraView(0.0, 0.0, 0.0, (), 0.0, picture)
    hog, lines = Hog(*region.shape), EdgeLines(model, region)
    part = np.ascontiguousarray(picture[region.part])
    at, rising = find_steep_edges(part)
    labels = dbscan(at, part.shape, CLUSTER_REACH, MIN_CLUSTER_EDGES)
    steps: tuple[Callable[[], object], ...] = (
        lambda: plain.detect(view),
        lambda: hog.blocks(part),
        lambda: find_steep_edges(part),
        lambda: dbscan(at, part.shape, CLUSTER_REACH, MIN_CLUSTER_EDGES),
        lambda: lines.nearest_lines(at, rising, labels),
    )
    compiled_ms = median_ms(lambda: fast.detect(view), repeat) if fast.calculated_by else math.nan
    return [compiled_ms, *(median_ms(step, repeat) for step in steps), float(at.size)]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--repeat", type=int, default=300, help="detections for each median")
    repeat = parser.parse_args().repeat
    cv2.setNumThreads(1)
    compiled.use_libraries_in(COMPILED_FOLDER)
    model = CameraModel()
    print(f"{'':10}" + "".join(f"{column:>12}" for column in COLUMNS))
    late = False
    with threadpool_limits(1):
        for name, picture in pictures(model).items():
            *times, pixels = measure(model, picture, repeat)
            in_a_run = times[1] if math.isnan(times[0]) else times[0]
            ratio = in_a_run / (GOAL if name == "clean" else FOUL_GOAL)
            figures = "".join(f"{value:12.2f}" for value in times)
            print(f"{name:10}{figures}{pixels:12.0f}{ratio:12.2f}")
            late |= ratio > 1.0
    return int(late)


if __name__ == "__main__":
    sys.exit(main())
