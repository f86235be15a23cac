"""`mutator watch` answers edits of every kind with the verdicts of a fresh run."""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest

import mutator
from mutator.errors import EXIT_OK, EXIT_WRONG_INPUT
from mutator.execution.watched_campaign import Verdict, verdict_of
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

_CLONE = Path(__file__).parents[2]
_CAMPAIGN = """\
schema: campaign/1
name: desk
about: What somebody works on.
target: toycar
scenarios: [A]
faults:
  - {spec: sensor/lane/shifted, values: 2}
  - {spec: sensor/silence/*}
methods: [guided]
triggers: {list: [{at_s: 2.0}]}
seed: 1
canary: {spec: sensor/lane/shifted, scenario: A, hazard: H3, at_s: 1.0}
limits: {cpu_s: 20, wall_s: 60, memory_mb: 1024, steps: 200}
"""
_CAMPAIGN_OF_SHIPPED_TARGET = """\
schema: campaign/1
name: desk
about: What somebody works on.
target: openpilot
scenarios: [S1]
faults:
  - {spec: radar_vision/relative_distance/longer, values: 1}
  - {spec: vision_output/path_model/both, values: 1}
  - {spec: car_sensors/speed/slower, values: 1}
reading: as_described
methods: [guided]
triggers: {list: [{at_s: 5.0}]}
seed: 1
canary: {spec: vision_output/path_model/both, scenario: S1, hazard: H3, at_s: 3.0}
limits: {cpu_s: 60, wall_s: 300, memory_mb: 4096, steps: 6000}
"""
_CONTROLS, _HONDA = "target/selfdrive/controls", "target/selfdrive/car/honda"
_CAMPAIGN_FILE, _TEMPLATE = "fault_library/campaigns/desk.yaml", "templates/offset.py.j2"
_DISTANCE = "fault_library/faults/radar_vision/relative_distance.yaml"
# file, old and new text: edits of the target, the library and the templates, each of what the one before left
_EDITS_OF_SHIPPED_FILES = (
    (
        "target/selfdrive/common/interp.py",
        "    if x >= xp[-1]:",
        "    # beyond the last\n    if x >= xp[-1]:",
    ),
    (f"{_CONTROLS}/lib/longcontrol.py", "STARTED_BRAKE = 0.2 ", "STARTED_BRAKE = 0.3 "),
    (f"{_HONDA}/carcontroller.py", "self._brake * BRAKE_COUNTS", "0.5 * self._brake * BRAKE_COUNTS"),
    (_TEMPLATE, "{{ by | signed }}\n", "{{ by | signed }} + 1.0\n"),
    (
        _DISTANCE,
        "{first: [15, 24], step: 10, last: [245, 254]}",
        "{first: [35, 44], step: 10, last: [45, 54]}",
    ),
    ("target/selfdrive/sim/scenario_page.py", "\nimport ", "\nimport math\nimport "),
    (_CAMPAIGN_FILE, "at_s: 5.0", "at_s: 6.0"),
    (f"{_HONDA}/interface.py", "((5.0, 20.0), (1.0, 0.8))", "((5.0, 20.0), (0.5, 0.4))"),
    (_CAMPAIGN_FILE, "path_model/both, values: 1}", "path_model/left, values: 1}"),
    (
        f"{_CONTROLS}/lib/state_machine.py",
        "self.state = DISABLED\n        for",
        "self.state = SOFT_DISABLING\n        for",
    ),
    ("fault_library/scenarios/S1.yaml", "speed_mph: 40", "speed_mph: 41"),
    (_TEMPLATE, "{{ by | signed }} + 1.0\n", "{{ by | signed }}\n"),
    (f"{_CONTROLS}/lib/radar_helpers.py", "(0.1988689, 0.28555364)", "(0.02, 0.003)"),
    (_DISTANCE, "Radar and camera report", "Both the radar and the camera report"),
    (f"{_CONTROLS}/plannerd.py", "MAX_AGE = 0.5", "MAX_AGE = 30.0"),
    ("fault_library/targets/openpilot.yaml", "> 0.5 * (3.7 - 1.8)", "> 0.1 * (3.7 - 1.8)"),
    (f"{_HONDA}/carcontroller.py", "0.5 * self._brake * BRAKE_COUNTS", "self._brake * BRAKE_COUNTS"),
    (_CAMPAIGN_FILE, "seed: 1", "seed: 2"),
    (f"{_HONDA}/carstate.py", "(0.12287673, 0.29666309)", "(0.03, 0.03)"),
    (_CAMPAIGN_FILE, "faults:\n", "faults:\n  - {spec: radar/chaff/*, values: 1}\n"),
)
_END_OF_PASS = "all: "


class Desk:
    """`mutator watch` in a process of its own, and the files that it watches."""

    def __init__(self, workspace: Workspace, place: Path, campaign: str = _CAMPAIGN) -> None:
        self.workspace, self.place, self.out = workspace, place, place / "watch"
        self.campaign = workspace.library / "campaigns" / "desk.yaml"
        self.campaign.write_text(campaign)
        command = [sys.executable, "-m", "mutator", "watch", "desk", "--out", str(self.out), "-n", "1"]
        places = {"MUTATOR_LIBRARY": str(workspace.library), "MUTATOR_TEMPLATES": str(workspace.templates)}
        self.process = subprocess.Popen(
            command,
            cwd=place,
            env=os.environ | places | {"PYTHONUNBUFFERED": "1", "COLUMNS": "200"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def read_until(self, *texts: str) -> list[str]:
        """Return the lines up to one that has one of the texts."""
        lines = []
        assert self.process.stdout is not None
        for line in self.process.stdout:
            lines.append(line.rstrip())
            if any(text in line for text in texts):
                return lines
        raise AssertionError("\n".join(lines))

    def edit(self, name: str, old: str, new: str) -> None:
        """Edit a file below the library's parent as editors do: write another one, and rename it."""
        path = self.workspace.library.parent / name
        text = path.read_text()
        assert old in text
        temporary = path.with_name(f".{path.name}.swp")
        temporary.write_text(text.replace(old, new, 1))
        temporary.rename(path)

    def verdicts(self) -> dict[str, Verdict]:
        folder = RunFolder.open(self.out / "now")
        assert folder.is_finished
        return {name: verdict_of(record) for name, record in folder.records().items()}

    def fresh_verdicts(self) -> dict[str, Verdict]:
        out = self.place / f"fresh{len(list(self.place.glob('fresh*')))}"
        run = mutator.run(self.campaign, out, engine="reference", reuse=False, workspace=self.workspace)
        return {name: verdict_of(record) for name, record in run.folder.records().items()}

    def end(self) -> int:
        self.process.send_signal(signal.SIGINT)
        self.process.communicate()
        return self.process.returncode

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def desk(tmp_path: Path, toycar: Workspace) -> Iterator[Desk]:
    desk = Desk(toycar, tmp_path)
    yield desk
    desk.kill()


def test_edits_of_each_kind_end_in_the_verdicts_of_a_fresh_run(desk: Desk) -> None:
    """A mistake in a spec, its correction, another spec, the campaign, a scenario and the target."""
    first = desk.read_until(_END_OF_PASS)
    assert any("hazard H3: sensor/lane/shifted" in line for line in first)
    assert desk.verdicts() == desk.fresh_verdicts()
    spec = "fault_library/faults/sensor/lane.yaml"
    desk.edit(spec, "schema:", "schema: [")
    lines = desk.read_until("waiting for the next edit")
    assert any(f"{spec}:" in line for line in lines), lines
    desk.edit(spec, "schema: [", "schema:")
    assert "nothing that this campaign runs has changed" in desk.read_until("nothing that")[-1]
    desk.edit("fault_library/campaigns/desk.yaml", "at_s: 2.0", "at_s: 2.5")
    lines = desk.read_until(_END_OF_PASS)
    assert lines[-1].startswith("new or changed: ")
    assert desk.verdicts() == desk.fresh_verdicts()
    desk.edit("tree/toycar/driver.py", "\n", "\nUNUSED = 1\n")
    lines = desk.read_until(_END_OF_PASS)
    assert lines[-1].startswith("unchanged: ")
    assert desk.verdicts() == desk.fresh_verdicts()
    assert desk.end() == EXIT_OK
    assert {path.name for path in desk.out.iterdir()} == {"now", "before", "owner.lock"}


def test_a_refused_edit_decides_the_exit_code(desk: Desk) -> None:
    """Ctrl-C after a mistake that was not corrected ends with the code of wrong input."""
    desk.read_until(_END_OF_PASS)
    desk.edit("fault_library/campaigns/desk.yaml", "scenarios: [A]", "scenarios: [C]")
    desk.read_until("waiting for the next edit")
    assert desk.end() == EXIT_WRONG_INPUT


def test_a_mistake_that_is_undone_leaves_the_exit_code_of_the_last_pass(desk: Desk) -> None:
    desk.read_until(_END_OF_PASS)
    desk.edit("fault_library/campaigns/desk.yaml", "scenarios: [A]", "scenarios: [C]")
    desk.read_until("waiting for the next edit")
    desk.edit("fault_library/campaigns/desk.yaml", "scenarios: [C]", "scenarios: [A]")
    desk.read_until("nothing that this campaign runs has changed")
    assert desk.end() == EXIT_OK


def test_an_edit_that_fails_a_check_leaves_no_run_that_looks_current(desk: Desk) -> None:
    """Once it is undone, the verdicts of before are run again, mostly from the store."""
    desk.read_until(_END_OF_PASS)
    verdicts = desk.verdicts()
    desk.edit("fault_library/campaigns/desk.yaml", "at_s: 1.0", "at_s: 5.9")
    lines = desk.read_until("waiting for the next edit")
    assert any("canary" in line for line in lines), lines
    desk.edit("fault_library/campaigns/desk.yaml", "at_s: 5.9", "at_s: 1.0")
    desk.read_until(_END_OF_PASS)
    assert desk.verdicts() == verdicts
    assert desk.end() == EXIT_OK


def test_an_edit_during_a_pass_begins_it_again(desk: Desk) -> None:
    """Its verdicts are those of the new files."""
    desk.read_until("watching desk")
    desk.edit("fault_library/campaigns/desk.yaml", "at_s: 2.0", "at_s: 3.0")
    lines = desk.read_until(_END_OF_PASS)
    assert any("which begins again" in line for line in lines), lines
    assert desk.verdicts() == desk.fresh_verdicts()


@pytest.fixture
def shipped_desk(tmp_path: Path) -> Iterator[Desk]:
    """A copy of the shipped files, in which the scenario is shorter."""
    for name in ("fault_library", "templates", "target"):
        ignored = shutil.ignore_patterns("__pycache__", "reviews")
        shutil.copytree(_CLONE / name, tmp_path / "copy" / name, ignore=ignored)
    scenario = tmp_path / "copy" / "fault_library" / "scenarios" / "S1.yaml"
    scenario.write_text(scenario.read_text().replace("duration_s: 30", "duration_s: 9"))
    desk = Desk(Workspace.find(root=tmp_path / "copy"), tmp_path, _CAMPAIGN_OF_SHIPPED_TARGET)
    yield desk
    desk.kill()


@pytest.mark.slow
def test_twenty_edits_of_shipped_files_end_in_the_verdicts_of_fresh_runs(shipped_desk: Desk) -> None:
    """Edits of the target, the library and the templates, of what runs execute and of what they do not."""
    shipped_desk.read_until(_END_OF_PASS)
    seen = [shipped_desk.verdicts()]
    for path, old, new in _EDITS_OF_SHIPPED_FILES:
        shipped_desk.edit(path, old, new)
        lines = shipped_desk.read_until(
            _END_OF_PASS, "nothing that this campaign", "waiting for the next edit"
        )
        assert "waiting" not in lines[-1], lines
        assert shipped_desk.verdicts() == shipped_desk.fresh_verdicts(), (path, new)
        seen.append(shipped_desk.verdicts())
    assert sum(before != after for before, after in pairwise(seen)) >= 5
    assert shipped_desk.end() == EXIT_OK
