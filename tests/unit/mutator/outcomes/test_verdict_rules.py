"""The verdict's truth table, and the events that the verdict uses."""

from collections.abc import Callable
from itertools import product

import pytest

from mutator.model import ObservedActivation, Outcome, Record
from mutator.outcomes.verdict_rules import (
    first_events_after,
    outcome_of,
    reaction_time,
    time_to_hazard,
    was_active_at_hazard,
)

ACTIVE = ObservedActivation(first=2.0, last=4.0, count=3)

# activated, manifested, a hazard at or after the activation -> outcome
TRUTH = {
    (False, False, False): Outcome.NOT_ACTIVATED,
    (False, False, True): Outcome.NOT_ACTIVATED,
    (False, True, False): Outcome.NOT_ACTIVATED,
    (False, True, True): Outcome.NOT_ACTIVATED,
    (True, False, False): Outcome.MASKED,
    (True, False, True): Outcome.HAZARD,
    (True, True, False): Outcome.SDC,
    (True, True, True): Outcome.HAZARD,
}


@pytest.mark.parametrize("case", list(product((False, True), repeat=3)), ids=str)
def test_the_outcome_follows_the_truth_table(case: tuple[bool, bool, bool]) -> None:
    activated, manifested, hazard = case
    outcome = outcome_of(
        activation=ACTIVE if activated else None,
        t_manifest=2.5 if manifested else None,
        hazards=(("H1", 3.0),) if hazard else (),
    )
    assert outcome is TRUTH[case]


@pytest.mark.parametrize(
    ("time", "counts"), [(0.0, False), (1.99, False), (2.0, True), (2.01, True), (9.0, True)]
)
def test_events_before_the_activation_are_ignored(time: float, counts: bool) -> None:
    assert first_events_after([("H1", time)], ACTIVE) == ((("H1", time),) if counts else ())


def test_without_an_activated_fault_there_are_no_events() -> None:
    assert first_events_after([("H1", 3.0), ("fcw", 0.0)], None) == ()


def test_the_first_event_of_each_name_is_kept() -> None:
    events = [("fcw", 1.0), ("b", 5.0), ("fcw", 4.0), ("fcw", 3.0), ("a", 5.0)]
    assert first_events_after(events, ACTIVE) == (("fcw", 3.0), ("a", 5.0), ("b", 5.0))


HAZARDS = (("H3", 5.0), ("H1", 7.0))


@pytest.mark.parametrize(
    ("hazards", "alerts", "expected"),
    [
        ((), (), None),
        (HAZARDS, (), None),
        ((), (("fcw", 3.0),), None),
        (HAZARDS, (("fcw", 3.0), ("can_error", 6.0)), 2.0),
        (HAZARDS, (("fcw", 5.0),), None),
        (HAZARDS, (("fcw", 6.0),), None),
    ],
    ids=["neither", "no alert", "no hazard", "alert first", "at once", "hazard first"],
)
def test_the_reaction_time_is_first_hazard_minus_first_alert(
    hazards: tuple, alerts: tuple, expected: float | None
) -> None:
    assert reaction_time(hazards, alerts) == expected


@pytest.mark.parametrize(
    ("activation", "hazard", "is_active"),
    [
        (ObservedActivation(first=2.0, last=30.0, count=2801), 4.0, True),
        (ObservedActivation(first=2.0, last=4.0, count=201), 4.0, True),
        (
            ObservedActivation(first=2.0, last=3.98, count=100),
            4.0,
            True,
        ),  # the run ended; the next one was due at 4.0
        (ObservedActivation(first=2.0, last=3.97, count=198), 4.0, False),
        (ObservedActivation(first=2.0, last=2.0, count=1), 4.0, False),
        (ObservedActivation(first=2.0, last=2.0, count=1), 2.0, True),
        (None, 4.0, False),
        (ObservedActivation(first=2.0, last=30.0, count=2801), None, False),
    ],
)
def test_a_fault_can_end_before_its_hazard(
    record: Callable[..., Record],
    activation: ObservedActivation | None,
    hazard: float | None,
    is_active: bool,
) -> None:
    """The time to the hazard counts from the activation all the same."""
    hazards = () if hazard is None else (("H1", hazard), ("H2", 9.0))
    finished = record(activation=activation, hazards=hazards)
    assert was_active_at_hazard(finished) == is_active
    expected = hazard - activation.first if activation and hazard is not None else None
    assert time_to_hazard(finished) == expected
