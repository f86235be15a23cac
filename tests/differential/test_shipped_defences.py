"""The shipped defences in fault-free drives of the shipped controller."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.defences.defence_fit import checked_actuation
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[2]
SCENARIOS = ("S1", "S2", "S3", "S4", "S5")
NAMES = sorted(path.stem for path in (CLONE / "fault_library" / "defences").glob("*.yaml"))
THREE_STAGE = [name for name in NAMES if name.startswith("aeb_three_stage")]

Drive = tuple[dict[str, Any], dict[str, np.ndarray]]


@pytest.fixture(scope="module")
def clone() -> Workspace:
    return Workspace.find(root=CLONE)


@pytest.mark.parametrize("name", NAMES)
def test_a_shipped_defence_fits_the_shipped_target(clone: Workspace, name: str) -> None:
    """Each of its numbers says what it means."""
    defence = clone.defence(name)
    checked_actuation(clone.manifest("openpilot"), defence)
    assert defence.reference
    assert all(parameter.about for parameter in defence.parameters)


def drive(clone: Workspace, names: tuple[str, ...], scenario: str, folder: Path) -> Drive:
    tree = folder / "-".join(("tree", *names))
    if not tree.exists():
        for path, data in clone.defended(clone.manifest("openpilot"), names).tree.files.items():
            (tree / path).parent.mkdir(parents=True, exist_ok=True)
            (tree / path).write_bytes(data)
    out = folder / "-".join(("run", scenario, *names))
    words = ["-m", "selfdrive.sim.run", "--scenario", str(clone.scenario(scenario)), "--out", str(out)]
    subprocess.run([sys.executable, *words], cwd=tree, check=True, env={"PYTHONPATH": str(tree)})
    with np.load(out / "trace.npz") as trace:
        return json.loads((out / "record.json").read_text()), dict(trace)


@pytest.fixture(scope="module")
def undefended(clone: Workspace, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Drive]:
    folder = tmp_path_factory.mktemp("undefended")
    return {scenario: drive(clone, (), scenario, folder) for scenario in SCENARIOS}


def differs_from(t: float, drive: Drive, other: Drive) -> bool:
    """Whether two drives differ in the step at `t` (s) for the first time."""
    (_, here), (_, there) = drive, other
    differs = np.any([here[name] != there[name] for name in here], axis=0)
    return bool(differs.any()) and here["t"][int(np.argmax(differs))] == pytest.approx(t)


def same(drive: Drive, other: Drive) -> bool:
    (_, here), (_, there) = drive, other
    return all(np.array_equal(here[name], there[name]) for name in here)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(NAMES) - set(THREE_STAGE)))
def test_a_defence_that_nothing_calls_for_changes_no_bit(
    clone: Workspace, undefended: dict[str, Drive], tmp_path: Path, name: str
) -> None:
    """The regulation's emergency braking, drivers and limits do nothing in fault-free drives."""
    for scenario in SCENARIOS:
        assert same(drive(clone, (name,), scenario, tmp_path), undefended[scenario]), scenario


@pytest.mark.slow
@pytest.mark.parametrize("name", THREE_STAGE)
def test_three_stage_braking_acts_in_s2_without_a_fault(
    clone: Workspace, undefended: dict[str, Drive], tmp_path: Path, name: str
) -> None:
    """It decides at 1.30 s, when the controller is engaged, so the car brakes from 1.31 s on: with 90 % of
    9 m/s^2 and the drag. Half a second later, this is H4.
    """
    for scenario in SCENARIOS:
        if scenario != "S2":
            assert same(drive(clone, (name,), scenario, tmp_path), undefended[scenario]), scenario
    record, trace = defended = drive(clone, (name,), "S2", tmp_path)
    assert differs_from(1.31, defended, undefended["S2"])
    assert trace["a_ego"][131] == pytest.approx(-8.1, abs=0.3)
    assert record["hazards"] == {"H1": None, "H2": None, "H3": None, "H4": 1.81}
