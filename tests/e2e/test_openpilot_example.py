"""The openpilot example: on a stand-in tree with openpilot's names, messages and calls, and on a real one.

The slow tests run on openpilot itself, built, if MUTATOR_TARGET names it.
"""

import math
import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mutator.cli.app import main
from mutator.workspace import Workspace

TESTS = Path(__file__).parents[1]
LIBRARY = TESTS.parent / "examples" / "openpilot" / "fault_library"
STAND_IN = TESTS / "openpilot" / "tree"
REAL = os.environ.get("MUTATOR_TARGET", "")
RADARD = "openpilot/selfdrive/controls/radard.py"


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    return Path(shutil.copytree(STAND_IN, tmp_path / "tree"))


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """The example's library without the packages that only openpilot itself needs."""
    library = Path(shutil.copytree(LIBRARY, tmp_path / "fault_library"))
    manifest = library / "targets" / "openpilot.yaml"
    text = manifest.read_text()
    assert ', "pycapnp>=2.1"' in text
    manifest.write_text(text.replace(', "pycapnp>=2.1"', ""))
    return library


def checked(library: Path, root: Path, capfd: pytest.CaptureFixture[str]) -> tuple[int, str]:
    capfd.readouterr()
    code = main(["--library", str(library), "--target", str(root), "check"])
    return code, capfd.readouterr().out


def test_the_whole_library_fits_the_tree(
    library: Path, tree: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, printed = checked(library, tree, capfd)
    assert code == 0 and "no problem" in printed


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        (RADARD, "lead_prob", "probability", "no assignment to 'lead_prob'"),
        (RADARD, "def update(self, d_rel,", "def advance(self, d_rel,", "Track.update"),
        (
            "cereal/messaging/__init__.py",
            "update_msgs(self, cur_time, msgs)",
            "update_msgs(self, now, all)",
            "msgs",
        ),
    ],
)
def test_a_changed_name_is_noticed(
    library: Path, tree: Path, capfd: pytest.CaptureFixture[str], file: str, old: str, new: str, said: str
) -> None:
    """A name that openpilot changes is reported before anything runs."""
    path = tree / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    code, printed = checked(library, tree, capfd)
    assert code == 1 and said in printed


@pytest.fixture
def overlay(tree: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Make the modules of overlay and tree importable, and forget them afterwards."""
    before = set(sys.modules)
    for folder in (tree, LIBRARY / "overlays" / "openpilot"):
        monkeypatch.syspath_prepend(str(folder))
    yield
    for name in set(sys.modules) - before:
        file = str(getattr(sys.modules[name], "__file__", None))
        if str(tree) in file or "overlays" in file:
            del sys.modules[name]


def run(scenario: str, tmp_path: Path, steps: int = 10_000) -> list[dict[str, float]]:
    from drive import Drive  # type: ignore[import-not-found]

    file = LIBRARY / "scenarios" / f"{scenario}.yaml"
    drive = Drive.open(["--scenario", str(file), "--seed", "1", "--out", str(tmp_path)])
    rows = []
    while not drive.done and len(rows) < steps:
        drive.step()
        rows.append(drive.recorded())
    return rows


@pytest.mark.usefixtures("overlay")
@pytest.mark.parametrize("scenario", ["maneuver", "brakes", "watched", "slower", "stopped"])
def test_the_car_stops_or_follows_without_a_fault(scenario: str, tmp_path: Path) -> None:
    rows = run(scenario, tmp_path)
    assert min(row["gap"] for row in rows) > 0 and max(row["gap"] for row in rows) < 200
    assert rows[-1]["speed"] == pytest.approx(rows[-1]["lead"], abs=3.0)


@pytest.mark.usefixtures("overlay")
def test_the_lead_that_radard_reports_is_the_real_one(tmp_path: Path) -> None:
    """The messages reach radard and the planner in the step in which they were sent."""
    for row in run("slower", tmp_path, 40):
        assert row["lead_seen"] and row["lead_gap"] == pytest.approx(row["gap"], abs=1.0)
        assert row["lead_speed"] == pytest.approx(15.0, abs=0.1)


def test_paths_begin_at_the_sensor_or_before_the_reader() -> None:
    """The code that is changed belongs to the reader, which can stop the fault."""
    workspace = Workspace.find(library=LIBRARY)
    analysis = workspace.analysis()
    assert analysis is not None
    for spec in workspace.specs():
        for variant in spec:
            components = analysis.structure.components
            begins = [n for n, one in components.items() if one.has_fault(f"{spec.name}/{variant.name}")]
            reader = f"to_{variant.name.partition('_')[0]}"
            expected = {"radar": ["radar"], "vision": ["vision"], "messages": [reader]}
            assert begins == expected.get(spec.module, []), (spec.name, variant.name)


@pytest.mark.usefixtures("overlay")
@pytest.mark.parametrize(
    ("scenario", "absent"), [("maneuver", "lead_seen"), ("brakes", "torque"), ("bend", "command")]
)
def test_a_channel_of_another_loop_has_no_value(scenario: str, absent: str, tmp_path: Path) -> None:
    """A zero would say that radard sees no lead, or that the car does not steer."""
    assert math.isnan(run(scenario, tmp_path, 1)[0][absent])


@pytest.mark.usefixtures("overlay")
def test_the_car_follows_the_bend_without_a_fault(tmp_path: Path) -> None:
    rows = run("bend", tmp_path)
    assert max(row["road"] for row in rows) > 0.001 and max(abs(row["offset"]) for row in rows) < 0.5


def trial(library: Path, out: Path, capfd: pytest.CaptureFixture[str], *words: str) -> str:
    words = (
        "--library",
        str(library),
        "--target",
        str(STAND_IN),
        "try",
        *words,
        "--out",
        str(out / "try"),
    )
    capfd.readouterr()
    assert main([*words]) == 0
    return capfd.readouterr().out


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("vision/lead", "--variant", "missing", "--scenario", "stopped"), "hazard COLLISION"),
        (
            ("lead/fused", "--variant", "distance_added", "--value", "40", "--scenario", "maneuver"),
            "hazard COLLISION",
        ),
        (
            (
                "steering/torque_controller",
                "--variant",
                "desired_scaled",
                "--value",
                "0",
                "--scenario",
                "bend",
            ),
            "hazard LANE",
        ),
        (("messages/lost", "--variant", "planner_radar_state", "--scenario", "brakes"), "alert comm_issue"),
        (("messages/lost", "--variant", "control_car_state", "--scenario", "brakes"), "verdict: "),
        (("messages/frozen", "--variant", "radard_model_v2", "--scenario", "brakes"), "manifested: "),
        (("vision/lead", "--variant", "late", "--value", "4", "--scenario", "brakes"), "manifested: "),
    ],
)
def test_a_fault_in_each_loop_does_what_it_says(
    library: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...], expected: str
) -> None:
    assert expected in trial(library, tmp_path, capfd, *words, "--trigger", "5")


def test_a_message_is_lost_for_one_reader_only(
    library: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Each reader has its own condition, because all readers share the code."""
    words = ("messages/lost", "--variant", "radard_live_tracks", "--scenario", "brakes", "--trigger", "5")
    printed = trial(library, tmp_path, capfd, *words)
    assert "'liveTracks' in self.services" in printed and "_fi.messages_lost(" in printed


@pytest.mark.parametrize("words", [("missing",), ("doubtful", "--value", "0.3")])
def test_vision_is_unsure_of_the_first_lead_only(
    library: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    printed = trial(
        library, tmp_path, capfd, "vision/lead", "--variant", *words, "--scenario", "brakes", "--trigger", "5"
    )
    assert "if _fi.on() and (i == 0) and _fi.active(" in printed


@pytest.mark.slow
@pytest.mark.skipif("openpilot" not in REAL, reason="MUTATOR_TARGET names no openpilot")
def test_the_library_fits_openpilot(capfd: pytest.CaptureFixture[str]) -> None:
    code, printed = checked(LIBRARY, Path(REAL), capfd)
    assert code == 0 and "no problem" in printed


@pytest.mark.slow
@pytest.mark.skipif("openpilot" not in REAL, reason="MUTATOR_TARGET names no openpilot")
def test_openpilot_brakes_for_what_vision_confirms(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The car collides if vision misses the lead, and without a warning."""
    capfd.readouterr()
    words = ["--library", str(LIBRARY), "--target", REAL, "try", "vision/lead", "--variant", "missing"]
    assert main([*words, "--scenario", "stopped", "--trigger", "1", "--out", str(tmp_path / "try")]) == 0
    printed = capfd.readouterr().out
    assert "hazard COLLISION" in printed and "no alert before the hazard" in printed
