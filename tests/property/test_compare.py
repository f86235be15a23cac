"""Comparisons of arbitrary results."""

import dataclasses

from hypothesis import given
from hypothesis import strategies as st

from mutator.comparison.experiment_matching import ExperimentPair, ResultChangeKind
from mutator.model import Outcome, Status
from mutator.results.result_rows import ResultRow

MIRROR = {
    ResultChangeKind.NEW_HAZARD: ResultChangeKind.HAZARD_GONE,
    ResultChangeKind.EARLIER_HAZARD: ResultChangeKind.LATER_HAZARD,
    ResultChangeKind.LOST_ALERT: ResultChangeKind.NEW_ALERT,
    ResultChangeKind.WORSE: ResultChangeKind.BETTER,
    ResultChangeKind.NEW_CRASH: ResultChangeKind.CRASH_GONE,
    ResultChangeKind.HARNESS_ERROR: ResultChangeKind.HARNESS_ERROR_GONE,
    ResultChangeKind.OTHER_HARMLESS_OUTCOME: ResultChangeKind.OTHER_HARMLESS_OUTCOME,
}
NO_OPPOSITE = {ResultChangeKind.OTHER_HAZARD, ResultChangeKind.NEW_SILENT_HAZARD}
ALERT_CHANGES = {ResultChangeKind.NEW_ALERT, ResultChangeKind.LOST_ALERT}
MIRROR |= {after: before for before, after in MIRROR.items()}
TIME = st.sampled_from([2.0, 2.5, 3.0, 7.25])


@st.composite
def rows(draw: st.DrawFn) -> ResultRow:
    """Draw a row, including some that no campaign can produce."""
    names = draw(st.lists(st.sampled_from(["H1", "H2"]), unique=True))
    hazards = tuple(sorted(((name, draw(TIME)) for name in names), key=lambda h: h[1]))
    status = draw(st.sampled_from(Status))
    outcome = draw(st.sampled_from(Outcome)) if status is Status.OK else None
    return ResultRow(
        **dict.fromkeys(("experiment_id", "kind", "variant", "value", "unit"), "x"),
        **dict.fromkeys(("scenario", "scenario_label", "trigger", "detail"), "x"),
        status=status,
        outcome=outcome,
        ending=(outcome or status).value,
        t_activation=draw(st.none() | st.just(1.5)),
        t_manifest=None,
        hazards=hazards,
        alerts=tuple(draw(st.lists(st.just("fcw"), max_size=1))),
        t_alert=None,
        reaction_time=None,
    )


@given(rows())
def test_a_run_does_not_differ_from_itself(row: ResultRow) -> None:
    assert ExperimentPair(None, None, row, dataclasses.replace(row)).change_kinds == set()  # type: ignore[arg-type]


@given(rows(), rows())
def test_swapping_two_runs_swaps_better_and_worse(a: ResultRow, b: ResultRow) -> None:
    """A different hazard, and a hazard that no alert comes before, have no opposite change; nor has an alert
    where there is a hazard in one run only, because a hazard that is gone needs none.
    """
    left_out = NO_OPPOSITE | (ALERT_CHANGES if bool(a.hazards) != bool(b.hazards) else set())
    there = ExperimentPair(None, None, a, b).change_kinds - left_out  # type: ignore[arg-type]
    back = ExperimentPair(None, None, b, a).change_kinds - left_out  # type: ignore[arg-type]
    assert {MIRROR[change] for change in there} == back
