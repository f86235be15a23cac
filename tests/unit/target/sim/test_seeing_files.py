"""Files that the detection memory depends on, and mutants of them."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import count
from pathlib import Path

import cv2
import pytest
from selfdrive.common import compiled
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim import compile_helpers
from selfdrive.sim.detection_memory import FILE_NAME
from selfdrive.sim.image_library import RENDERED_SPACING
from selfdrive.sim.remembering_detector import DETECTION_FILES
from selfdrive.sim.road_renderer import RoadRenderer

from mutator._common import cache_layout_and_pruning
from mutator.engines.engine_jobs import Job
from mutator.engines.job_tree_pool import JobTreePool
from mutator.engines.reference_engine import ReferenceEngine
from mutator.limits import Limits
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Status
from mutator.mutants.mutant_building import build
from mutator.targets.source_tree import matches_any_glob
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[4]
Drive = Callable[..., tuple[str, str]]


@pytest.fixture
def drive(tmp_path: Path) -> Drive:
    """Run a mutant for a second on three frames. Return its record and its counts. The fault follows the
    assignment at `place` (file, function, name)."""
    frames, work = tmp_path / "frames", tmp_path / "work"
    frames.mkdir()
    work.mkdir()
    values = {"files": "*.png", "width": 640, "rows": 480, "fx_px": 309.4, "fy_px": 344.2, "cx_px": 317.9}
    values |= {"cy_px": 256.5, "height_m": 2.18, "pitch_deg": 14, "spacing_m": RENDERED_SPACING}
    (frames / "camera.yaml").write_text(json.dumps({"schema": "camera/1", "name": "three"} | values))
    renderer = RoadRenderer(CameraModel(), "solid", 0, periods=1)
    for number in range(3):
        cv2.imwrite(str(frames / f"{number}.png"), renderer.render_grey(number * RENDERED_SPACING))
    workspace = Workspace.find(root=ROOT)
    manifest, models = workspace.manifest("openpilot"), workspace.fault_models()
    more = ("--pictures", "--frames", str(frames), "--max-steps", "100")
    manifest = replace(manifest, entry_args=(*manifest.entry_args, *more))
    numbers = count()

    def driven(place: tuple[str, str, str], time_s: float, *, independent: bool = False) -> tuple[str, str]:
        path, function, name = place
        anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name=name)
        location = FaultLocation(path=path, function=function, anchor=anchor)
        params = (("by", -1000.0), ("target", name))
        injection = Injection(location=location, model="offset", params=params)
        fault = Fault("s", "m", "f", "as_described", None, "", "H1", (injection,))
        made = build(manifest, models, fault, trigger_at_time(time_s))
        engine = ReferenceEngine(manifest, work, Limits(), independent=independent)
        job = Job(
            name="job",
            scenario=workspace.scenario("S1"),
            seed=0,
            changed_files=made.files,
            mutant_id=made.id,
            injection_ids=made.injection_ids,
        )
        execution = engine.execute(job, work / str(next(numbers)))
        assert execution.status is Status.OK and execution.probe_report, execution.detail
        return (execution.out / "record.json").read_text(), json.dumps(execution.probe_report["injections"])

    return driven


def memory() -> Path:
    """The folder where the harness lets the target store detections."""
    return cache_layout_and_pruning.target_cache_folder("openpilot") / FILE_NAME


def test_the_manifest_lists_every_file_that_affects_detection() -> None:
    """A mutant's tree has all files that the memory's key covers; a mutant of one is run from the disk.

    The key does not cover visiond and the camera, so their faults can be forked.
    """
    manifest = Workspace.find(root=ROOT).manifest("openpilot")
    package = ROOT / "target" / "selfdrive"
    seeing = {
        f"selfdrive/{p.relative_to(package).as_posix()}"
        for glob in DETECTION_FILES
        for p in package.glob(glob)
    }
    assert len(seeing) > 30
    assert [path for path in sorted(seeing) if not matches_any_glob(path, manifest.file_globs)] == []
    assert [
        path
        for path in sorted(seeing)
        if path.endswith(".py") and not matches_any_glob(path, manifest.globs_read_by_runs)
    ] == []
    for path in (
        "selfdrive/visiond/visiond.py",
        "selfdrive/sim/picture_camera.py",
        "selfdrive/sim/simulator.py",
    ):
        assert not matches_any_glob(path, manifest.globs_read_by_runs)


def test_the_manifest_lists_every_file_that_compiled_code_replaces() -> None:
    """A mutant of a file with compiled code runs from the disk, so the compiled code is not found.

    The code that chooses between the two accepts no faults.
    """
    manifest = Workspace.find(root=ROOT).manifest("openpilot")
    target = ROOT / "target"
    stood_for = {
        (source.parent / name).resolve().relative_to(target).as_posix()
        for source in target.rglob("*.c")
        for name in compiled.stands_for(source.read_bytes())
        if name.endswith(".py")
    }
    assert len(stood_for) > 6
    assert [
        path for path in sorted(stood_for) if not matches_any_glob(path, manifest.globs_read_by_runs)
    ] == []
    choosing = [path.relative_to(target).as_posix() for path in target.rglob("compiled_*.py")]
    assert [path for path in sorted(choosing) if not matches_any_glob(path, manifest.forbidden_globs)] == []


def test_a_mutants_tree_finds_all_compiled_code(tmp_path: Path) -> None:
    """A mutant's tree has everything that identifies a library.

    If a header were missing, for example, the slow Python code would run.
    """
    manifest, target = Workspace.find(root=ROOT).manifest("openpilot"), ROOT / "target"
    tree = (
        JobTreePool(manifest.tree, tmp_path, manifest.entry_module).lay_out_tree(tmp_path / "tree", {}).folder
    )
    found = {
        source.name: (compiled.file_name(source), compiled.file_name(tree / source.relative_to(target)))
        for source in target.rglob("*.c")
    }
    assert len(found) > 6
    assert [name for name, (here, there) in found.items() if here != there] == []


@pytest.mark.slow
def test_a_fault_in_a_detector_does_not_depend_on_earlier_runs(drive: Drive) -> None:
    place = ("selfdrive/visiond/paper_detector.py", "PaperDetector._windows_with_mark", "score")
    early, late = (drive(place, time_s, independent=True) for time_s in (0.3, 0.7))
    assert early[0] != late[0] and '"count": 14' in early[1] and '"count": 6' in late[1]
    assert [drive(place, time_s) for time_s in (0.3, 0.3, 0.7)] == [early, early, late]
    assert not memory().exists()


@pytest.mark.slow
@pytest.mark.skipif(
    not any(compile_helpers.COMPILED_FOLDER.glob("mark_windows-*")), reason="nothing is compiled"
)
def test_a_fault_in_code_with_a_compiled_version_is_activated(drive: Drive) -> None:
    place = ("selfdrive/visiond/hog.py", "Hog._vote_by_cell", "votes")
    acted = drive(place, 0.3)
    assert '"count": 14' in acted[1] and acted == drive(place, 0.3, independent=True)


def test_a_fault_outside_detection_keeps_the_memory_in_use(drive: Drive) -> None:
    drive(("selfdrive/controls/lib/latcontrol.py", "LatControl.plan", "factor"), 0.3)
    assert memory().exists()
