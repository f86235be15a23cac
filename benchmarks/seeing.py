"""Which difference between the readings makes faults of pictures hazardous: `python benchmarks/seeing.py`.

The paper's text and its authors' code differ in how pictures are made and seen. This turns each difference
on alone, then all of them, then all but one, on the reference plant, and counts the runs that end in a
hazard. An effect is active from 1.5 s on, in every context that a scenario reaches. `--csv FILE` keeps every
run.
"""

import argparse
import csv
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from multiprocessing import Pool
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import cv2

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "target"))

from selfdrive.common.camera_model import CameraModel  # noqa: E402
from selfdrive.messages import CameraView  # noqa: E402
from selfdrive.sim import effects, simulator  # noqa: E402
from selfdrive.sim.effects.effect import Effect, Moment  # noqa: E402
from selfdrive.sim.effects.levels import LEVELS  # noqa: E402
from selfdrive.sim.moved_picture import CodedView  # noqa: E402
from selfdrive.sim.picture_camera import PictureCamera  # noqa: E402
from selfdrive.sim.reference_plant import ReferencePlant  # noqa: E402
from selfdrive.sim.scenario import REFERENCE, load_scenario, on_plant  # noqa: E402
from selfdrive.sim.truth import GroundTruth  # noqa: E402
from selfdrive.sim.vision import Pictures  # noqa: E402
from selfdrive.visiond import coded_detector  # noqa: E402
from selfdrive.visiond.coded_detector import CodedDetector  # noqa: E402
from selfdrive.visiond.detector import LaneLines, MirroredDetector, RoadLine, path_between  # noqa: E402
from selfdrive.visiond.paper_detector import PaperDetector  # noqa: E402

Parts = frozenset[str]
LATCHING, REDRAWING, MARKS, RIM = "latching", "redrawing", "marks", "rim"
CLUSTERS, MISSING, PATH, MOVE, LABELS = "clusters", "missing line", "path", "move", "labels"
DIFFERENCES = {
    LATCHING: "an effect stays to the end of the run",
    REDRAWING: "every picture is drawn anew",
    MARKS: "streaks, fog and flakes as coded; effects on the recorded picture, before it is moved",
    RIM: "occlusion by black blobs with a gray rim, instead of soft dark ones",
    CLUSTERS: "the detector as coded: windows, edges and clusters",
    MISSING: "a line that is not seen is sent as 8 m to the left, with full confidence",
    PATH: "the path is straight ahead, with full confidence",
    MOVE: "the picture moves as a whole, and shows 64 % of the way",
    LABELS: "left and right are swapped in the picture and for the controller",
}
NONE, ALL = frozenset[str](), frozenset(DIFFERENCES)
ARMED_FROM = 1.5  # s
SAFE_HEADWAY = 2.0  # s
CONTEXTS: dict[str, Callable[[float, float], bool]] = {  # of headway time and of how much slower the lead is
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
DRAWINGS = 20  # of an effect as described, from which each picture has one where it is drawn anew
CYCLE = 0.05  # s between pictures
FRAMES = "SEEING_FRAMES"  # variable with the folder in which runs share the frames that they draw


class Case(NamedTuple):
    """A run; `effect` "" is the fault-free one."""

    parts: Parts
    scenario: str
    context: str = ""
    effect: str = ""
    level: int = 0


class Ending(NamedTuple):
    """The contexts that came, the first hazard ("" for none), and whether there was an alert."""

    reached: frozenset[str]
    hazard: str
    alert: bool


class TrueLabels(ReferencePlant):
    """The reference plant, whose pictures show which side the car is on."""

    mirrors = False

    def pictured(self, truth: GroundTruth) -> GroundTruth:
        """All there is."""
        return truth


class FaultyCamera(PictureCamera):
    """A camera with the case's effect in front of it while its context holds."""

    def __init__(self, camera: PictureCamera, case: Case) -> None:
        self._geometry, self._library, self._move = camera._geometry, camera._library, camera._move
        self.model = camera.model
        self._case, self._active, self.reached = case, False, NONE
        if MOVE in case.parts:
            self._move = CodedView()

    def look(self, truth: GroundTruth) -> CameraView:
        """The view at this moment."""
        case = self._case
        self._update(truth)
        frame = self._library.frame(truth.t, truth.position)
        if self._active and MARKS in case.parts:
            frame = self._affected(frame, truth)
        picture = self._move.seen(frame, truth.lateral_offset, truth.heading)
        if self._active and MARKS not in case.parts:
            picture = self._affected(picture, truth)
        return self._geometry.look(truth)._replace(picture=picture)

    def _update(self, truth: GroundTruth) -> None:
        if truth.t >= ARMED_FROM:
            slower = truth.v_ego - truth.v_lead
            here = frozenset(name for name, holds in CONTEXTS.items() if holds(truth.hwt, slower))
            self.reached |= here
            self._active = self._case.context in (self.reached if LATCHING in self._case.parts else here)

    def _affected(self, picture, truth: GroundTruth):
        case = self._case
        redrawn, number = REDRAWING in case.parts, round(truth.t / CYCLE)
        coded = (RIM if case.effect == "occlusion" else MARKS) in case.parts
        effect = drawing(
            case.effect, case.level, coded, number % DRAWINGS if redrawn and not coded else 0, self.model
        )
        if coded and not redrawn:  # these are drawn for a time
            return effect.apply(picture, Moment(0.0, truth.position, truth.v_ego))
        return effect.apply(picture, truth)


@cache
def drawing(name: str, level: int, coded: bool, number: int, camera: CameraModel) -> Effect:
    """One of the effect's drawings at a level of 1 to 10."""
    kind = KINDS[name][coded]
    amounts = LEVELS[kind]
    return kind(amounts[-(-level * len(amounts) // 10) - 1], 1 + number, camera)


class MixedDetector:
    """The detector of either reading, with the other one's way to tell a missing line and the path."""

    def __init__(self, parts: Parts, camera: CameraModel) -> None:
        self._parts = parts
        self._detector = (CodedDetector if CLUSTERS in parts else PaperDetector)(camera)
        inward = coded_detector.INWARD
        self._nowhere = tuple(
            coded_detector.metres(coded_detector.MISSING + side) for side in (inward, -inward)
        )

    def detect(self, view: CameraView) -> LaneLines:
        """The lines in this view."""
        left, right, path = self._detector.detect(view)
        left, right = (
            self._told(*one) for one in zip((left, right), self._nowhere, (1.85, -1.85), strict=True)
        )
        path = RoadLine(y=0.0) if PATH in self._parts else path_between(left, right)
        return LaneLines(left, right, path)

    def _told(self, line: RoadLine, nowhere: float, expected: float) -> RoadLine:
        if MISSING in self._parts:
            return RoadLine(y=nowhere) if line.prob == 0.0 else line
        return RoadLine(y=expected, prob=0.0) if line.y == nowhere else line


def drive(case: Case) -> tuple[Case, Ending]:
    """Run a case."""
    cv2.setNumThreads(1)
    simulator.PLANTS[REFERENCE] = ReferencePlant if LABELS in case.parts else TrueLabels
    scenario = load_scenario(ROOT / "fault_library" / "scenarios" / f"{case.scenario}.yaml")
    run = simulator.Simulator()
    run.reset(on_plant(scenario, REFERENCE), 1, Pictures(cache=Path(os.environ[FRAMES])))
    run._camera = camera = FaultyCamera(run._camera, case)
    detector = MixedDetector(case.parts, camera.model)
    run.manager.visiond._detector = MirroredDetector(detector) if LABELS in case.parts else detector
    while not run.done:
        run.step()
    record = run.result().record
    hazards = sorted((t, name) for name, t in record["hazards"].items() if t is not None)
    return case, Ending(camera.reached, hazards[0][1] if hazards else "", bool(record["alerts"]))


def cases(free: dict[Case, Ending], levels: Sequence[int]) -> Iterator[Case]:
    """What to drive, given the fault-free runs. All but one is tried where there are hazards at all."""
    for golden, ending in free.items():
        some = 1 < len(golden.parts) < len(ALL)
        names = [name for name in KINDS if not some or name in ("rain", "snow", "occlusion", "contrast")]
        for context in sorted(ending.reached):
            yield from (
                golden._replace(context=context, effect=name, level=level)
                for name in names
                for level in levels
            )


def title(parts: Parts) -> str:
    """A row's name."""
    if len(parts) > 1 and ALL - parts:
        return "all but " + ", ".join(ALL - parts)
    return "all: as coded" if parts else "none: as described"


def report(runs: dict[Case, Ending], rows: Sequence[Parts]) -> None:
    """Markdown: for each row the hazards of each effect, and what its fault-free runs do."""
    print("| differences |", *(f"{name} |" for name in KINDS), "fault-free |")
    print("| --- |" + " --- |" * (len(KINDS) + 1))
    for parts in rows:
        name = next(iter(parts)) if len(parts) == 1 else title(parts)
        cells = []
        for effect in KINDS:
            found = [end for case, end in runs.items() if case.parts == parts and case.effect == effect]
            cells.append(f"{sum(map(bool, (end.hazard for end in found)))} of {len(found)}" if found else "")
        free = [(case, end) for case, end in runs.items() if case.parts == parts and not case.effect]
        told = [f"{case.scenario}: {end.hazard or 'alert'}" for case, end in free if end.hazard or end.alert]
        print(f"| {name} |", *(f"{cell} |" for cell in cells), ", ".join(told) or "nothing", "|")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0] + ".")
    parser.add_argument("-n", type=int, default=2, metavar="N", help="processes (2)")
    parser.add_argument("--scenarios", nargs="+", default=["S1", "S5"])
    parser.add_argument(
        "--levels", type=int, nargs="+", choices=range(1, 11), default=[5, 10], metavar="LEVEL"
    )
    parser.add_argument("--csv", type=Path, metavar="FILE", help="keep every run")
    options = parser.parse_args()
    alone = [frozenset({name}) for name in DIFFERENCES]
    rows = [NONE, *alone, ALL, *(ALL - one for one in alone)]
    with TemporaryDirectory() as frames:
        os.environ[FRAMES] = frames
        with Pool(options.n) as pool:
            golden = [Case(parts, scenario) for parts in rows for scenario in options.scenarios]
            free = dict(pool.imap_unordered(drive, golden))
            faulty = sorted(cases(free, options.levels), key=lambda case: rows.index(case.parts))
            runs = free | dict(pool.imap(drive, faulty))
    report(runs, rows)
    if options.csv:
        with options.csv.open("w", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(("differences", *Case._fields[1:], "hazard", "alert"))
            for case, end in runs.items():
                writer.writerow((" + ".join(sorted(case.parts)), *case[1:], end.hazard, end.alert))
    return 0


if __name__ == "__main__":
    sys.exit(main())
