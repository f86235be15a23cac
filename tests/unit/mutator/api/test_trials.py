"""Trials of single faults."""

from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.limits import MeasuredLimits
from mutator.model import Outcome, Status
from mutator.workspace import Workspace


def test_a_fault_can_be_tried_by_name(toycar: Workspace) -> None:
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


def test_a_given_value_replaces_the_drawn_values(toycar: Workspace, tmp_path: Path) -> None:
    trial = mutator.try_fault(
        "sensor/distance/longer", "A", "near", value=12.5, workspace=toycar, out=tmp_path / "o"
    )
    assert trial.fault.value == 12.5
    assert "gap = gap + 12.5" in trial.diff
    assert trial.folder == tmp_path / "o" / trial.id
    assert (trial.folder / "mutant.patch").read_text() == trial.patch
    assert (trial.scenario, trial.trigger) == (trial.experiment.scenario, trial.experiment.trigger)
    assert trial.trigger.condition == "hwt <= 2.0"


def test_a_fault_record_can_be_tried_but_only_without_a_value(toycar: Workspace) -> None:
    [fault] = toycar.faults("hostile/crash")
    trial = mutator.try_fault(fault, "A", workspace=toycar)
    assert trial.fault is fault
    assert trial.status is Status.CRASHED
    assert trial.record.detail
    with pytest.raises(MutatorError, match="together with a value"):
        mutator.try_fault(fault, "A", value=3.0, workspace=toycar)


def test_the_temporary_folder_is_deleted_with_the_trial(toycar: Workspace) -> None:
    trial = mutator.try_fault("sensor/lane/shifted", "A", 5.0, workspace=toycar)
    folder = trial.folder
    assert folder.is_dir()
    del trial
    assert not folder.exists()


def test_a_faulty_run_that_deletes_its_output_is_a_crash(toycar: Workspace) -> None:
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
def test_an_unknown_name_is_an_error_that_lists_the_known_ones(
    toycar: Workspace, fault: str, scenario: str, trigger: str, said: str
) -> None:
    with pytest.raises(MutatorError, match=said):
        mutator.try_fault(fault, scenario, trigger, workspace=toycar)


@pytest.mark.slow
def test_a_fault_that_hangs_costs_ten_times_its_golden_run(toycar: Workspace) -> None:
    trial = mutator.try_fault("hostile/hang", "A", 1.0, workspace=toycar)
    assert (trial.status, trial.record.detail) == (Status.TIMEOUT, MeasuredLimits().cpu_limit_text)
