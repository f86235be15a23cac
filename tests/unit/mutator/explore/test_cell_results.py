"""What a record says about its cell."""

from dataclasses import replace

import pytest

from mutator.explore.cell_results import CellState, Drive, judge_cell
from mutator.model import Outcome, Record, Status

DRIVE = Drive(start_s=10.0, end_s=40.0, step_s=0.01)
OBSERVE_S = 15.0


def record(
    outcome: Outcome | None, hazards: tuple[tuple[str, float], ...] = (), status: Status = Status.OK
) -> Record:
    return Record(
        experiment_id="e",
        status=status,
        outcome=outcome,
        detail="",
        tree="",
        activation=None,
        t_manifest=None,
        max_dev=(),
        hazards=hazards,
        alerts=(),
        trace_digest="",
        metrics=(("margin_h1", 3.0), ("smallest_gap", 3.0)),
    )


@pytest.mark.parametrize(
    ("outcome", "duration_s", "state"),
    [
        (Outcome.SDC, 15.0, CellState.WITHOUT_HAZARD),
        (Outcome.SDC, 15.01, CellState.NOT_DECIDED),  # 14.99 s to observe
        (Outcome.MASKED, 15.0, CellState.WITHOUT_HAZARD),
        (
            Outcome.MASKED,
            28.0,
            CellState.WITHOUT_HAZARD,
        ),  # it never left golden, also for 2 s after the fault
        (Outcome.MASKED, 28.1, CellState.NOT_DECIDED),
        (Outcome.NOT_ACTIVATED, 15.0, CellState.WITHOUT_HAZARD),
        (Outcome.NOT_JUDGED, 1.0, CellState.NOT_DECIDED),
    ],
)
def test_without_a_hazard_the_drive_must_go_on(outcome: Outcome, duration_s: float, state: CellState) -> None:
    run = record(outcome)
    run = replace(run, t_manifest=10.0) if outcome is Outcome.SDC else run
    assert judge_cell(run, duration_s, DRIVE, OBSERVE_S).state is state


@pytest.mark.parametrize(
    ("t_back", "duration_s", "state"),
    [
        (30.0, 20.0, CellState.WITHOUT_HAZARD),  # 10 s to observe, all as golden
        (38.0, 20.0, CellState.WITHOUT_HAZARD),
        (35.0, 28.1, CellState.NOT_DECIDED),  # as golden before the fault ended, and for 1.9 s after it
        (None, 20.0, CellState.NOT_DECIDED),  # never back
        (None, 15.0, CellState.WITHOUT_HAZARD),
    ],
)
def test_a_run_that_came_back_to_golden_is_decided(
    t_back: float | None, duration_s: float, state: CellState
) -> None:
    """It must end as golden, for 2 s after the fault."""
    run = replace(record(Outcome.SDC), t_manifest=10.0, t_back=t_back)
    assert judge_cell(run, duration_s, DRIVE, OBSERVE_S).state is state


def test_a_controller_that_ends_disengaged_has_not_survived() -> None:
    """Nor one that crashed; but a hazard is a hazard."""
    run = replace(record(Outcome.SDC), ended_disengaged=True)
    assert judge_cell(run, 1.0, DRIVE, OBSERVE_S).state is CellState.DISENGAGED
    crashed = record(None, status=Status.CRASHED)
    assert judge_cell(crashed, 1.0, DRIVE, OBSERVE_S).state is CellState.DISENGAGED
    hit = replace(record(Outcome.HAZARD, (("H1", 12.0),)), ended_disengaged=True)
    assert judge_cell(hit, 3.0, DRIVE, OBSERVE_S).state is CellState.HAZARDOUS


def test_a_fault_that_was_never_active_is_told() -> None:
    """So that nobody calls it survived."""
    assert not judge_cell(record(Outcome.NOT_ACTIVATED), 1.0, DRIVE, OBSERVE_S).is_activated
    assert judge_cell(record(Outcome.MASKED), 1.0, DRIVE, OBSERVE_S).is_activated


def test_a_hazard_during_the_fault_is_that_of_longer_faults() -> None:
    """It came 2 s after the start: each fault of 2.02 s or more does the same up to then."""
    result = judge_cell(record(Outcome.HAZARD, (("H1", 12.0),)), 3.0, DRIVE, OBSERVE_S)
    assert (result.state, result.hazard) == (CellState.HAZARDOUS, "H1")
    assert (result.time_to_hazard_s, result.inferred_from_s) == (2.0, 2.02)


@pytest.mark.parametrize("duration_s", [0.5, 2.0, 2.01])
def test_nothing_follows_from_a_hazard_after_the_fault(duration_s: float) -> None:
    """The end of a fault is an event of its own, so a longer one may be survived."""
    result = judge_cell(record(Outcome.HAZARD, (("H1", 12.0),)), duration_s, DRIVE, OBSERVE_S)
    assert result.state is CellState.HAZARDOUS and result.inferred_from_s is None


@pytest.mark.parametrize("status", [Status.TIMEOUT, Status.LEFT_OUT, Status.INVALID_MUTANT])
def test_a_run_that_did_not_work_decides_nothing(status: Status) -> None:
    result = judge_cell(record(None, status=status), 1.0, DRIVE, OBSERVE_S)
    assert result.state is CellState.NOT_DECIDED and status in result.reason


def test_margins_are_those_of_hazards() -> None:
    assert judge_cell(record(Outcome.SDC), 1.0, DRIVE, OBSERVE_S).margins == {"margin_h1": 3.0}
