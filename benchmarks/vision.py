"""Measure the cost of frames: drawing one, moving it to the car's pose, opening the library, and whole runs.

`python benchmarks/vision.py [render] [view] [library] [runs] [--repeat N]`. Times are CPU times of this
process, in one thread. The result is the median; the minimum shows the idle machine's speed.
"""

import argparse
import statistics
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

import cv2  # noqa: E402
from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.sim.detection_memory import FILE_NAME  # noqa: E402
from selfdrive.sim.image_library import RENDERED_SPACING, open_frame_library  # noqa: E402
from selfdrive.sim.moved_picture import HomographyMover, ShiftMover  # noqa: E402
from selfdrive.sim.picture import Picture  # noqa: E402
from selfdrive.sim.picture_options import DETECTORS, PictureOptions  # noqa: E402
from selfdrive.sim.road_renderer import RoadRenderer  # noqa: E402
from selfdrive.sim.run import simulate  # noqa: E402
from selfdrive.sim.scenario import load_scenario  # noqa: E402
from selfdrive.visiond.road_region import RoadRegion  # noqa: E402

GOALS = {"render": 2.0, "view": 0.75}  # ms: a grey frame of 640 x 480, moved by the ground's homography
RUN_GOAL = 1500.0  # ms: 30 s of simulation without cached detections


def times(work: Callable[[int], object], repeat: int) -> list[float]:
    """Return the CPU time of each call (ms), without the first, which warms up."""
    spent = [spent_in(partial(work, number)) for number in range(repeat + 1)]
    return spent[1:]


def show(name: str, spent: list[float], goal: float | None = None) -> bool:
    median = statistics.median(spent)
    against = "" if goal is None else f"  {median / goal:.2f} of the goal of {goal:g} ms"
    print(f"  {name:34} median {median:8.3f} ms  fastest {min(spent):8.3f} ms{against}")
    return goal is None or median <= goal


def render(repeat: int) -> bool:
    """Draw consecutive frames of the standard road, from mid-lane and from an offset, turned pose."""
    renderer = RoadRenderer(CameraModel(), "dashed", 0)
    straight = times(lambda number: renderer.render_grey(number * RENDERED_SPACING), repeat)
    aside = times(lambda number: renderer.render_grey(number * RENDERED_SPACING, 0.5, 0.02), repeat)
    build = times(lambda number: RoadRenderer(CameraModel(), "dashed", number), 5)
    good = show("render: grey frame", straight, GOALS["render"])
    good &= show("render: offset and turned", aside, GOALS["render"])
    show("render: painting 97.6 m of road", build)
    return good


def view(repeat: int) -> bool:
    model = CameraModel()
    drawn = RoadRenderer(model, "dashed", 0, periods=1).render_grey(0.0)
    frame = Picture(("drawn",), drawn.shape, lambda region: drawn[region.part])
    ground, shifted = HomographyMover(model), ShiftMover(model)
    whole = times(lambda number: ground.seen(frame, 0.01 * number, 0.02).pixels(), repeat)
    part = RoadRegion(model).part
    looked_at = times(lambda number: ground.seen(frame, 0.01 * number, 0.02)[part], repeat)
    good = show("view: ground", whole, GOALS["view"])
    show("view: ground, used by `paper`", looked_at)
    show("view: shift", times(lambda number: shifted.seen(frame, 0.01, 0.0).pixels(), repeat))
    return good


def library(repeat: int) -> bool:
    with TemporaryDirectory() as folder:
        pictures = PictureOptions(cache=Path(folder))
        made = [spent_in(partial(open_frame_library, pictures, seed)) for seed in range(2)]
        show("library: cold, 600 frames", made)
        show("library: warm", times(lambda number: open_frame_library(pictures, 0), 5))
    return True


def runs(repeat: int) -> bool:
    """Simulate 30 s without frames, with frames but no cached detections, and with cached detections."""
    scenario, good = load_scenario(ROOT / "fault_library/scenarios/S1.yaml"), True
    show("runs: without pictures", times(lambda number: simulate(scenario, 0), 2))
    with TemporaryDirectory() as folder:
        for detector in DETECTORS:
            pictures = PictureOptions(detector=detector, cache=Path(folder))
            work = partial(simulate, scenario, 0, pictures)
            work()
            unknown = []
            for _ in range(3):
                (Path(folder) / FILE_NAME).unlink()
                unknown.append(spent_in(work))
            good &= show(f"runs: {detector}, uncached", unknown, RUN_GOAL)
            show(f"runs: {detector}, cached", [spent_in(work) for _ in range(3)])
    return good


def spent_in(work: Callable[[], object]) -> float:
    start = process_time()
    work()
    return 1000.0 * (process_time() - start)


def main() -> None:
    parts = {"render": render, "view": view, "library": library, "runs": runs}
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join(parts)}; all if none is given"
    )
    parser.add_argument("--repeat", type=int, default=300, help="calls, of which the median is reported")
    options = parser.parse_args()
    for part in options.parts:
        if part not in parts:
            parser.error(f"{part!r} is not one of {', '.join(parts)}")
    cv2.setNumThreads(1)
    print("CPU time in one thread:")
    good = [parts[part](options.repeat) for part in options.parts or parts]
    sys.exit(0 if all(good) else 1)


if __name__ == "__main__":
    main()
