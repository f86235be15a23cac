"""Try one fault."""

from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.model import Outcome, Status
from mutator.workspace import Workspace


def test_a_fault_is_tried(toycar: Workspace) -> None:
    """A fault tried by name, at a time, has a diff, a verdict, frames by time, and a figure for notebooks."""
    trial = mutator.try_fault("sensor/lane/shifted", "A", 1.0, workspace=toycar)
    assert (trial.outcome, trial.status) == (Outcome.HAZARD, Status.OK)
    assert "H3" in trial.verdict["hazards_s"]
    assert "+++ b/toycar/sensing.py" in trial.diff
    assert "_fi.py" in trial.patch
    traces = trial.traces()
    assert traces.golden.index.name == traces.faulty.index.name == "time"
    assert traces.faulty.attrs["units"]["speed"] == "m/s"
    before = traces.difference.loc[:0.9]
    assert (before == 0.0).all(axis=None)
    assert traces.difference.abs().max().max() > 0.0
    assert trial.plot()._repr_png_().startswith(b"\x89PNG")  # type: ignore[attr-defined]
    assert "hazard" in repr(trial)
    assert "toycar/sensing.py" in trial._repr_html_()


def test_a_value_is_taken_exactly(toycar: Workspace, tmp_path: Path) -> None:
    """`value` replaces the drawn values, and `out` keeps all files."""
    trial = mutator.try_fault(
        "sensor/distance/longer", "A", "near", value=12.5, workspace=toycar, out=tmp_path / "o"
    )
    assert trial.fault.value == 12.5
    assert "gap = gap + 12.5" in trial.diff
    assert trial.folder == tmp_path / "o" / trial.id
    assert (trial.folder / "mutant.patch").read_text() == trial.patch
    assert (trial.scenario, trial.trigger) == (trial.experiment.scenario, trial.experiment.trigger)
    assert trial.trigger.condition == "hwt <= 2.0"


def test_any_fault_of_the_library_can_be_tried(toycar: Workspace) -> None:
    """A Fault record is tried unchanged. A crash of the controller is a result, with the data recorded
    before it."""
    [fault] = toycar.faults("hostile/crash")
    trial = mutator.try_fault(fault, "A", workspace=toycar)
    assert trial.fault is fault
    assert trial.status is Status.CRASHED
    assert trial.record.detail
    with pytest.raises(MutatorError, match="together with a value"):
        mutator.try_fault(fault, "A", value=3.0, workspace=toycar)


def test_a_temporary_folder_goes_with_the_trial(toycar: Workspace) -> None:
    trial = mutator.try_fault("sensor/lane/shifted", "A", 5.0, workspace=toycar)
    folder = trial.folder
    assert folder.is_dir()
    del trial
    assert not folder.exists()


def test_a_trial_that_deletes_its_output(toycar: Workspace) -> None:
    """A faulty run that deletes its output folder is a valid result, a crash."""
    driver = toycar.library.parent / "tree" / "toycar" / "driver.py"
    lost = "        if gap > 500.0:\n            import os, shutil\n            shutil.rmtree(os.getcwd())\n"
    old = "        wanted ="
    driver.write_text(driver.read_text().replace(old, f"{lost}{old}", 1))
    trial = mutator.try_fault("sensor/distance/longer", "A", 1.0, value=900.0, workspace=toycar)
    assert trial.status is Status.CRASHED
    assert list((trial.folder / "faulty").iterdir()) == []


@pytest.mark.parametrize(
    ("fault", "scenario", "trigger", "said"),
    [
        ("sensor/lan", "A", "always", "did you mean 'sensor/lane'"),
        ("sensor/lane/bent", "A", "always", "no variant 'bent'.*expected one of shifted"),
        ("sensor/lane", "Z", "always", "no scenario 'Z'; expected one of A, B"),
        ("sensor/lane", "A", "hwt <", "expected a context"),
    ],
)
def test_mistakes_are_told(toycar: Workspace, fault: str, scenario: str, trigger: str, said: str) -> None:
    """The error for an unknown name lists the known names."""
    with pytest.raises(MutatorError, match=said):
        mutator.try_fault(fault, scenario, trigger, workspace=toycar)
