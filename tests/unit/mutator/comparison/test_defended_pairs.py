"""What became of an experiment's hazard with defences."""

from typing import Any

import pytest

from mutator.comparison.defended_pairs import DefendedRow, PairOutcome, pair_of
from mutator.model import Outcome, Status
from mutator.results.result_rows import ResultRow

OBSERVE_S = 15.0
H1, H2, BOTH = (("H1", 5.0),), (("H2", 6.0),), (("H1", 5.0), ("H2", 6.0))
OVER = {"after_fault_s": OBSERVE_S}


def row(hazards: tuple[tuple[str, float], ...], **given: Any) -> ResultRow:
    text = dict.fromkeys(("experiment_id", "kind", "variant", "unit", "scenario", "scenario_label"), "x")
    none = dict.fromkeys(("value", "t_activation", "t_manifest", "t_alert", "reaction_time"))
    fields: dict[str, Any] = {
        **text,
        **none,
        "trigger": "x",
        "status": Status.OK,
        "outcome": Outcome.HAZARD if hazards else Outcome.SDC,
        "alerts": (),
        "detail": "",
    } | given
    ending = (fields["outcome"] or fields["status"]).value
    return ResultRow(hazards=hazards, ending=ending, **fields)


def facts(**given: Any) -> DefendedRow:
    fields: dict[str, Any] = {
        "acted": ("aeb",),
        "conflict_steps": 0,
        "after_fault_s": 1.0,
        "end_speed": 20.0,
        "driver_at_end": False,
        "authority": {},
    }
    return DefendedRow(**fields | given)


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        ({}, PairOutcome.OPEN),
        ({"after_fault_s": OBSERVE_S - 0.1}, PairOutcome.OPEN),
        ({"after_fault_s": OBSERVE_S}, PairOutcome.PREVENTED),
        ({"after_fault_s": None}, PairOutcome.OPEN),
        ({"end_speed": 0.0}, PairOutcome.PREVENTED),
        ({"end_speed": 0.3}, PairOutcome.OPEN),
        ({"end_speed": None}, PairOutcome.OPEN),
        ({"driver_at_end": True}, PairOutcome.PREVENTED),
    ],
)
def test_a_hazard_is_prevented_only_if_none_can_follow(end: dict[str, Any], outcome: PairOutcome) -> None:
    """The fault is long over, the car stands, or a driver has it. A fault that was never active can still
    come, so it leaves the hazard open.
    """
    assert pair_of(row(H1), row(()), facts(**end), OBSERVE_S).outcome is outcome


@pytest.mark.parametrize(
    ("before", "after", "outcome"),
    [
        (row(()), row(()), PairOutcome.NO_HAZARD),
        (row(()), row(H1), PairOutcome.CAUSED),
        (row(H1), row(H2), PairOutcome.REPLACED),
        (row(H1), row(H2, severity="S3"), PairOutcome.REPLACED),
        (row(H1), row(H1), PairOutcome.UNCHANGED),
        (row(H1), row(BOTH), PairOutcome.WORSENED),
        (row(BOTH), row(H1), PairOutcome.MITIGATED),
        (row(H1, severity="S3"), row(H1, severity="S1"), PairOutcome.MITIGATED),
        (row(H1, severity="S1"), row(H1, severity="S3"), PairOutcome.WORSENED),
        (row(BOTH, severity="S1"), row(H1, severity="S3"), PairOutcome.WORSENED),
        (row(H1, delta_v=5.0), row(H1, delta_v=3.0), PairOutcome.MITIGATED),
        (row(H1, delta_v=3.0), row(H1, delta_v=5.0), PairOutcome.WORSENED),
        (row(H1, delta_v=3.0), row(H1, delta_v=3.05), PairOutcome.UNCHANGED),
        (row(H1), row((), status=Status.CRASHED, outcome=None), PairOutcome.NOT_COMPARED),
        (row((), status=Status.TIMEOUT, outcome=None), row(()), PairOutcome.NOT_COMPARED),
        (row((), outcome=Outcome.NOT_JUDGED), row(H1), PairOutcome.NOT_COMPARED),
    ],
)
def test_hazards_without_and_with_defences_are_compared(
    before: ResultRow, after: ResultRow, outcome: PairOutcome
) -> None:
    """First which hazards there are, then their severity, then the contact. Another hazard instead never
    counts as prevented, however mild it is; a crash is no result.
    """
    assert pair_of(before, after, facts(**OVER), OBSERVE_S).outcome is outcome


@pytest.mark.parametrize(
    ("before", "acted", "is_unneeded"),
    [
        (row(()), ("aeb",), True),
        (row(()), (), False),
        (row(H1), ("aeb",), False),
        (row((), status=Status.CRASHED, outcome=None), ("aeb",), False),
    ],
)
def test_an_activation_is_unneeded_if_there_was_nothing_to_prevent(
    before: ResultRow, acted: tuple[str, ...], is_unneeded: bool
) -> None:
    """Whether or not a hazard followed it."""
    pair = pair_of(before, row(()), facts(acted=acted), OBSERVE_S)
    assert pair.is_unneeded_activation is is_unneeded
