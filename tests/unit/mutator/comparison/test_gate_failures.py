"""The experiments on which gates fail."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.comparison.gate_failures import RECOMMENDED_GATES, failing_experiments, worst_first
from mutator.comparison.run_comparison_and_gates import Comparison, Gate, compare_runs, findings_of_gates
from mutator.model import Experiment, Outcome, Status
from mutator.workspace import Workspace


def became(e: Experiment) -> dict[str, Any]:
    if e.fault.fault_type == "lane":
        alert = (("brake_hard", 2.5),) if e.scenario == "A" else ()
        return {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),), "alerts": alert}
    return {"status": Status.CRASHED, "outcome": None} if e.fault.fault_type == "silence" else {}


@pytest.fixture(scope="module")
def compared(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Comparison:
    place = tmp_path_factory.mktemp("runs")
    toycar = copy_toycar(place)
    part = write_run(toycar, place / "part", limit=20)
    return compare_runs(part, write_run(toycar, place / "after", became))


def test_an_experiment_that_fails_several_gates_comes_once(compared: Comparison) -> None:
    findings = findings_of_gates(compared, RECOMMENDED_GATES)
    failing = failing_experiments(compared, findings)
    assert len({each.experiment.id for each in failing}) == len(failing) < len(findings)
    assert sum(len(each.gates) for each in failing) == len(findings)
    silent = [each for each in failing if Gate.NEW_SILENT_HAZARD in each.gates]
    assert silent
    assert {each.gates_text for each in silent} == {"new-hazard, new-silent-hazard"}
    unmatched = [each for each in failing if each.pair is None]
    assert {each.gates for each in unmatched} == {(Gate.UNMATCHED,)}
    assert len(unmatched) == len(compared.matching.only_b) == 4


def test_silent_hazards_come_first_and_crashes_after_hazards(compared: Comparison) -> None:
    failing = failing_experiments(compared, findings_of_gates(compared, RECOMMENDED_GATES))
    rows = [compared.b.row_by_id[each.experiment.id] for each in worst_first(compared, failing)]
    kinds = [(row.ending, bool(row.alerts)) for row in rows]
    order = [("hazard", False), ("hazard", True), ("crashed", False), ("masked", False)]
    assert {*kinds} >= {*order[:3]}
    assert kinds == sorted(kinds, key=order.index)


def test_experiments_without_a_result_in_the_second_run_come_last(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    whole, part = write_run(toycar, tmp_path / "whole"), write_run(toycar, tmp_path / "p", became, limit=20)
    compared = compare_runs(whole, part)
    failing = failing_experiments(compared, findings_of_gates(compared, RECOMMENDED_GATES))
    places = [Gate.UNMATCHED in each.gates for each in worst_first(compared, failing)]
    assert sum(places) == 4
    assert places == sorted(places)
