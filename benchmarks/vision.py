"""What pictures cost: drawing a frame, moving it to the car's pose, and opening the image library.

`python benchmarks/vision.py [render] [view] [library] [--repeat N]`. Times are CPU time of this process, in
one thread; the median counts, and the fastest tells what the machine can do when nothing else runs on it.
Exit code 1 where a median misses its goal.
"""

import argparse
import statistics
import sys
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

import cv2  # noqa: E402
from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.sim.image_library import SPACING, open_library  # noqa: E402
from selfdrive.sim.picture_camera import GroundView, ShiftedView  # noqa: E402
from selfdrive.sim.road_renderer import RoadRenderer  # noqa: E402
from selfdrive.sim.vision import Pictures  # noqa: E402

GOALS = {"render": 2.0, "view": 0.75}  # ms: a grey frame of 640 x 480, moved by the ground's homography


def times(work: Callable[[int], object], repeat: int) -> list[float]:
    """CPU time of each call (ms), but for the first, which warms up."""
    spent = []
    for number in range(repeat + 1):
        start = process_time()
        work(number)
        spent.append(1000.0 * (process_time() - start))
    return spent[1:]


def show(name: str, spent: list[float], goal: float | None = None) -> bool:
    """Print a line of the table; whether the goal was met."""
    median = statistics.median(spent)
    against = "" if goal is None else f"  {median / goal:.2f} of the goal of {goal:g} ms"
    print(f"  {name:34} median {median:8.3f} ms  fastest {min(spent):8.3f} ms{against}")
    return goal is None or median <= goal


def render(repeat: int) -> bool:
    """Frames of the standard road, one after the other, and seen from elsewhere."""
    renderer = RoadRenderer(CameraModel(), "dashed", 0)
    straight = times(lambda number: renderer.grey(number * SPACING), repeat)
    aside = times(lambda number: renderer.grey(number * SPACING, 0.5, 0.02), repeat)
    build = times(lambda number: RoadRenderer(CameraModel(), "dashed", number), 5)
    good = show("render: grey frame", straight, GOALS["render"])
    good &= show("render: from aside, turned", aside, GOALS["render"])
    show("render: painting 97.6 m of road", build)
    return good


def view(repeat: int) -> bool:
    """One frame moved to a pose that changes."""
    model = CameraModel()
    frame = RoadRenderer(model, "dashed", 0, periods=1).grey(0.0)
    ground, shifted = GroundView(model), ShiftedView(model)
    good = show("view: ground", times(lambda n: ground.seen(frame, 0.01 * n, 0.02), repeat), GOALS["view"])
    show("view: shift", times(lambda number: shifted.seen(frame, 0.01, 0.0), repeat))
    return good


def library(repeat: int) -> bool:
    """The image library, made anew and then from its cache."""
    with TemporaryDirectory() as folder:
        pictures = Pictures(cache=Path(folder))
        show("library: cold, 600 frames", [cold(pictures, seed) for seed in range(2)])
        show("library: warm", times(lambda number: open_library(pictures, 0), 5))
    return True


def cold(pictures: Pictures, seed: int) -> float:
    """CPU time (ms) of opening a library that is not in the cache."""
    start = process_time()
    open_library(pictures, seed)
    return 1000.0 * (process_time() - start)


def main() -> None:
    """Measure and print; exit 1 where a goal is missed."""
    parts = {"render": render, "view": view, "library": library}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(parts)}; all if none is given"
    )
    parser.add_argument("--repeat", type=int, default=300, help="calls, of which the median counts")
    options = parser.parse_args()
    for part in options.parts:
        if part not in parts:
            parser.error(f"{part!r} is none of {', '.join(parts)}")
    cv2.setNumThreads(1)
    print("CPU time in one thread:")
    good = [parts[part](options.repeat) for part in options.parts or parts]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
