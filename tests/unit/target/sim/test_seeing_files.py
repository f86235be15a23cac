"""The manifest's `reads_itself` against what the detections' memory depends on."""

from pathlib import Path

from selfdrive.sim.remembering_detector import SEEING

from mutator.sources import matches
from mutator.workspace import Workspace

ROOT = Path(__file__).resolve().parents[4]


def test_the_manifest_names_every_file_that_sees() -> None:
    """A mutant of a file whose bytes the memory's key has is run where that file is on the disk; faults in
    visiond and in the camera, which are not in the key, can be forked."""
    manifest = Workspace.find(root=ROOT).manifest("openpilot")
    package = ROOT / "target" / "selfdrive"
    seeing = {f"selfdrive/{p.relative_to(package).as_posix()}" for glob in SEEING for p in package.glob(glob)}
    assert len(seeing) > 30
    assert [
        path for path in sorted(seeing) if path.endswith(".py") and not matches(path, manifest.reads_itself)
    ] == []
    for path in (
        "selfdrive/visiond/visiond.py",
        "selfdrive/sim/picture_camera.py",
        "selfdrive/sim/simulator.py",
    ):
        assert not matches(path, manifest.reads_itself)
