"""Find the differences between the readings that make image faults hazardous: `python benchmarks/seeing.py`.

The paper's text and its authors' code differ in how frames are made and seen. The benchmark enables each
difference alone and then all of them, on the reference plant, with every effect at each level in every
context that a scenario reaches, and counts the runs that end in a hazard. If all of them together cause
hazards, it also removes each difference in turn, and tries other thresholds of the detector as coded. `--csv
FILE` stores every run.
"""

import argparse
import csv
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import product
from multiprocessing import Pool
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.messages import CameraView  # noqa: E402
from selfdrive.sim import effects, simulator  # noqa: E402
from selfdrive.sim.effects.effect import Effect, Moment  # noqa: E402
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT  # noqa: E402
from selfdrive.sim.moved_picture import AuthorsCodeShiftMover  # noqa: E402
from selfdrive.sim.picture import Picture  # noqa: E402
from selfdrive.sim.picture_camera import PictureCamera  # noqa: E402
from selfdrive.sim.picture_options import PictureOptions  # noqa: E402
from selfdrive.sim.reference_plant import ReferencePlant  # noqa: E402
from selfdrive.sim.scenario import REFERENCE_PLANT, load_scenario, with_plant  # noqa: E402
from selfdrive.sim.truth import GroundTruth  # noqa: E402
from selfdrive.visiond import authors_code_detector  # noqa: E402
from selfdrive.visiond.authors_code_detector import AuthorsCodeDetector  # noqa: E402
from selfdrive.visiond.detector import (  # noqa: E402
    LANE_WIDTH,
    LaneLines,
    MirroredDetector,
    RoadLine,
    path_between,
)
from selfdrive.visiond.paper_detector import PaperDetector  # noqa: E402

ARMING, LATCHING, REDRAWING, MARKS, RIM = "arming", "latching", "redrawing", "marks", "rim"
PLACE, CLUSTERS, MISSING, PATH = "place", "clusters", "missing line", "path"
MOVE, LABELS = "move", "labels"
DIFFERENCES = {
    ARMING: "triggers are armed at the start instead of at 1.5 s",
    LATCHING: "an effect stays to the end of the run",
    REDRAWING: "every picture is drawn anew; otherwise, marks as coded do not move",
    MARKS: "streaks, fog and flakes as coded",
    RIM: "occlusion by black blobs with a grey rim, instead of soft dark ones",
    PLACE: "effects are drawn before the picture is moved to the car's pose",
    CLUSTERS: "the detector as coded: windows, edges and clusters",
    MISSING: "a line that is not seen is sent as 8 m to the left, with full confidence",
    PATH: "the path is straight ahead, with full confidence",
    MOVE: "the picture is shifted as a whole, by 64 % of the car's offset",
    LABELS: "left and right are swapped in the picture and for the controller",
}
ARMED_FROM = 1.5  # s, without ARMING
THRESHOLDS = 2.0, 3.0  # in addition to the detector's own
SAFE_HEADWAY = 2.0  # s
CONTEXTS: dict[str, Callable[[float, float], bool]] = {  # by headway time and how much slower the lead is
    "C1": lambda hwt, slower: hwt <= SAFE_HEADWAY and slower <= 0.0,
    "C2": lambda hwt, slower: hwt <= SAFE_HEADWAY and slower > 0.0,
    "C3": lambda hwt, slower: hwt > SAFE_HEADWAY and slower <= 0.0,
    "C4": lambda hwt, slower: hwt > SAFE_HEADWAY and slower > 0.0,
}
KINDS: dict[str, tuple[type[Effect], type[Effect]]] = {  # as described, as coded
    "rain": (effects.PaperRain, effects.CodedRain),
    "fog": (effects.PaperFog, effects.CodedFog),
    "snow": (effects.PaperSnow, effects.CodedSnow),
    "occlusion": (effects.PaperOcclusion, effects.CodedOcclusion),
    "contrast": (effects.Contrast, effects.Contrast),
    "brightness": (effects.Brightness, effects.Brightness),
    "blur": (effects.AveragingBlur, effects.AveragingBlur),
}
DRAWINGS = 20  # number of seeds of an effect as described: each frame uses the next one
CYCLE = 0.05  # s between frames
FRAMES = "SEEING_FRAMES"  # environment variable that names the folder of shared frames


class Row(NamedTuple):
    """A row of the table: the enabled differences, and the coded detector's threshold for a mark."""

    name: str
    parts: frozenset[str]
    threshold: float = authors_code_detector.MIN_LOG_ODDS


class Case(NamedTuple):
    """A run, fault-free if `effect` is ""."""

    row: Row
    scenario: str
    context: str = ""
    effect: str = ""
    level: int = 0


class Ending(NamedTuple):
    """The contexts reached, the first hazard ("" for none) and whether there was an alert."""

    reached: frozenset[str]
    hazard: str
    alert: bool


ALL = Row("all: as coded", frozenset(DIFFERENCES))
FIRST = [
    Row("none: as described", frozenset()),
    *(Row(f"{name} alone", frozenset({name})) for name in DIFFERENCES),
    ALL,
]
THEN = [
    *(Row(f"all but {name}", ALL.parts - {name}) for name in DIFFERENCES),
    *(Row(f"all, threshold {value:g}", ALL.parts, value) for value in THRESHOLDS),
]


class TrueLabels(ReferencePlant):
    """A reference plant that does not swap left and right in frames."""

    has_mirrored_messages = False

    def pictured(self, truth: GroundTruth) -> GroundTruth:
        return truth


class FaultyCamera(PictureCamera):
    def __init__(self, camera: PictureCamera, case: Case) -> None:
        self._geometry, self._library, self._move = camera._geometry, camera._library, camera._move
        self.model = camera.model
        self._case, self._parts = case, case.row.parts
        self._active, self.reached = False, frozenset[str]()
        if MOVE in self._parts:
            self._move = AuthorsCodeShiftMover()

    def look(self, truth: GroundTruth) -> CameraView:
        self._update(truth)
        frame = self._library.frame(truth.t, truth.position)
        if self._active and PLACE in self._parts:
            frame = self._affected(frame, truth)
        picture = self._move.seen(frame, truth.lateral_offset, truth.heading)
        if self._active and PLACE not in self._parts:
            picture = self._affected(picture, truth)
        return self._geometry.look(truth)._replace(picture=np.asarray(picture))

    def _update(self, truth: GroundTruth) -> None:
        if ARMING in self._parts or truth.t >= ARMED_FROM:
            slower = truth.v_ego - truth.v_lead
            here = frozenset(name for name, holds in CONTEXTS.items() if holds(truth.hwt, slower))
            self.reached |= here
            self._active = self._case.context in (self.reached if LATCHING in self._parts else here)

    def _affected(self, picture: Picture, truth: GroundTruth) -> Picture:
        case, redrawn = self._case, REDRAWING in self._parts
        coded = (RIM if case.effect == "occlusion" else MARKS) in self._parts
        number = round(truth.t / CYCLE) % DRAWINGS if redrawn and not coded else 0
        effect = drawing(case.effect, case.level, coded, number, self.model)
        moment = Moment(0.0, truth.position, truth.v_ego) if coded and not redrawn else truth
        affected = effect.apply(picture, moment)
        assert isinstance(affected, Picture), "the effect returned no Picture"
        return affected


@cache
def drawing(name: str, level: int, coded: bool, number: int, camera: CameraModel) -> Effect:
    """Return the effect at a level of 1 to 10, drawn with one of its seeds."""
    kind = KINDS[name][coded]
    amounts = AMOUNTS_BY_EFFECT[kind]
    return kind(amounts[-(-level * len(amounts) // 10) - 1], 1 + number, camera)


class MixedDetector:
    """A lane detector that combines the rules of both readings."""

    def __init__(self, row: Row, camera: CameraModel) -> None:
        self._parts = row.parts
        coded = CLUSTERS in row.parts
        self._detector = AuthorsCodeDetector(camera, row.threshold) if coded else PaperDetector(camera)
        inward = authors_code_detector.INWARD_PIXELS
        self._nowhere = [
            authors_code_detector.lateral_position(authors_code_detector.MISSING_LINE_COLUMN + side)
            for side in (inward, -inward)
        ]
        self._last = [RoadLine(y=side * LANE_WIDTH) for side in (0.5, -0.5)]

    def detect(self, view: CameraView) -> LaneLines:
        lines = list(self._detector.detect(view)[:2])
        if CLUSTERS in self._parts and MISSING not in self._parts:
            lines = [self._unseen(*pair) for pair in enumerate(lines)]
        if MISSING in self._parts and CLUSTERS not in self._parts:
            lines = self._sent(lines)
        left, right = lines
        path = RoadLine(y=0.0) if PATH in self._parts else path_between(left, right)
        return LaneLines(left, right, path)

    def _unseen(self, side: int, line: RoadLine) -> RoadLine:
        """Return the line, with zero probability if the detector as coded has no cluster for it."""
        return line._replace(prob=0.0) if line.y == self._nowhere[side] else line

    def _sent(self, lines: list[RoadLine]) -> list[RoadLine]:
        """Return the lines, a missing one 8 m to the left. If both are missing, return the last ones."""
        if any(line.prob > 0.0 for line in lines):
            pairs = zip(lines, self._nowhere, strict=True)
            self._last = [line if line.prob > 0.0 else RoadLine(y=nowhere) for line, nowhere in pairs]
        return self._last


def drive(case: Case) -> tuple[Case, Ending]:
    cv2.setNumThreads(1)
    labels = LABELS in case.row.parts
    simulator.PLANT_CLASSES[REFERENCE_PLANT] = ReferencePlant if labels else TrueLabels
    scenario = load_scenario(ROOT / "fault_library" / "scenarios" / f"{case.scenario}.yaml")
    run = simulator.Simulator()
    run.reset(with_plant(scenario, REFERENCE_PLANT), 1, PictureOptions(cache=Path(os.environ[FRAMES])))
    assert isinstance(run._camera, PictureCamera)
    run._camera = camera = FaultyCamera(run._camera, case)
    detector = MixedDetector(case.row, camera.model)
    run.manager.visiond._detector = MirroredDetector(detector) if labels else detector
    while not run.is_finished:
        run.step()
    record = run.result().record
    hazards = sorted((t, name) for name, t in record["hazards"].items() if t is not None)
    return case, Ending(camera.reached, hazards[0][1] if hazards else "", bool(record["alerts"]))


def faulty(free: dict[Case, Ending], names: Iterable[str], levels: Sequence[int]) -> Iterator[Case]:
    """Yield the runs with these effects, in the contexts that the fault-free ones reach."""
    for golden, ending in free.items():
        for context, name, level in product(sorted(ending.reached), names, levels):
            yield golden._replace(context=context, effect=name, level=level)


def report(runs: dict[Case, Ending], rows: Sequence[Row]) -> None:
    """Print Markdown: for each row the hazards of each effect, and the result of its fault-free runs."""
    print("| differences |", *(f"{name} |" for name in KINDS), "fault-free |")
    print("| --- |" + " --- |" * (len(KINDS) + 1))
    for row in rows:
        ends = {case: end for case, end in runs.items() if case.row == row}
        cells = []
        for effect in KINDS:
            found = [bool(end.hazard) for case, end in ends.items() if case.effect == effect]
            cells.append(f"{sum(found)} of {len(found)}" if found else "")
        told = [
            f"{case.scenario}: {' and '.join(filter(None, (end.hazard, 'alert' if end.alert else '')))}"
            for case, end in ends.items()
            if not case.effect and (end.hazard or end.alert)
        ]
        print(f"| {row.name} |", *(f"{cell} |" for cell in cells), ", ".join(told) or "nothing", "|")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0] + ".")
    parser.add_argument("-n", type=int, default=2, metavar="N", help="processes (2)")
    parser.add_argument("--scenarios", nargs="+", default=["S1", "S5"])
    parser.add_argument(
        "--levels", type=int, nargs="+", choices=range(1, 11), default=[5, 10], metavar="LEVEL"
    )
    parser.add_argument("--effects", nargs="+", choices=KINDS, default=list(KINDS), metavar="NAME")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="store every run in this file")
    options = parser.parse_args()
    runs: dict[Case, Ending] = {}
    with TemporaryDirectory() as frames:
        os.environ[FRAMES] = frames
        with Pool(options.n) as pool:

            def all_of(rows: Sequence[Row], names: Iterable[str]) -> None:
                golden = [Case(row, scenario) for row in rows for scenario in options.scenarios]
                free = dict(pool.imap(drive, golden))
                runs.update(free)
                runs.update(pool.imap(drive, faulty(free, names, options.levels)))

            all_of(FIRST, options.effects)
            bad = {case.effect for case, end in runs.items() if case.row == ALL and end.hazard}
            all_of(THEN, [name for name in options.effects if name in bad])
    print(f"Hazards at levels {options.levels}, in every context that scenarios {options.scenarios} reach.\n")
    report(runs, [*FIRST, *THEN])
    for name, about in DIFFERENCES.items():
        print(f"{name}: {about}")
    if options.csv:
        with options.csv.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("row", *Case._fields[1:], "hazard", "alert"))
            for case, end in runs.items():
                writer.writerow((case.row.name, *case[1:], end.hazard, end.alert))
    return 0


if __name__ == "__main__":
    sys.exit(main())
