"""The verdict's truth table, and the events that the verdict uses."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from typing import Any

import pytest

from mutator.model import AfterHazard, Experiment, Hold, ObservedActivation, Outcome, Record
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


LONG, TO_HAZARD = (2.0, 30.0, 2801), (2.0, 4.0, 201)  # first, last and count of the activations
SHORT_OF_IT, ONCE = (2.0, 3.98, 100), (2.0, 2.0, 1)  # the next of SHORT_OF_IT is due at 4.0
TWO_BURSTS = (1.0, 20.0, 12)  # from 1.0 to 1.1, and at 20
FAR_APART = (1.0, 9.0, 2)


@pytest.mark.parametrize(
    ("activation", "hazard", "hold", "is_active"),
    [
        (LONG, 4.0, Hold.TO_END, True),
        (TO_HAZARD, 4.0, Hold.TO_END, True),
        (TO_HAZARD, 4.0, Hold.FOR, True),
        (TO_HAZARD, 4.0, Hold.WHILE, True),
        (SHORT_OF_IT, 4.0, Hold.TO_END, False),
        (ONCE, 4.0, Hold.TO_END, False),
        (ONCE, 2.0, Hold.WHILE, True),
        (LONG, 4.0, Hold.WHILE, False),
        (TWO_BURSTS, 5.0, Hold.WHILE, False),
        (FAR_APART, 15.0, Hold.WHILE, False),
        (FAR_APART, 15.0, Hold.TO_END, False),
        (FAR_APART, 15.0, Hold.FOR, False),
        (None, 4.0, Hold.TO_END, False),
        (LONG, None, Hold.TO_END, False),
    ],
)
def test_only_a_fault_that_provably_acted_at_the_hazard_was_active_then(
    record: Callable[..., Record],
    experiment: Callable[..., Experiment],
    activation: tuple[float, float, int] | None,
    hazard: float | None,
    hold: Hold,
    is_active: bool,
) -> None:
    """A fault with `while` can pause. The time to the hazard counts from the activation all the same."""
    hazards = () if hazard is None else (("H1", hazard), ("H2", 29.0))
    finished = record(activation=_activation(activation), hazards=hazards, t_end=hazard)
    assert was_active_at_hazard(finished, _holding(experiment(), hold)) == is_active
    expected = hazard - activation[0] if activation and hazard is not None else None
    assert time_to_hazard(finished) == expected


@pytest.mark.parametrize(
    ("activation", "t_end", "hold", "is_active"),
    [
        (SHORT_OF_IT, 4.0, Hold.TO_END, True),
        (SHORT_OF_IT, 4.0, Hold.FOR, False),
        (SHORT_OF_IT, 4.0, Hold.WHILE, False),
        (SHORT_OF_IT, 6.0, Hold.TO_END, False),  # another hazard stopped the run
        ((2.0, 3.97, 198), 4.0, Hold.TO_END, False),
    ],
)
def test_a_run_that_stopped_at_the_hazard_can_lack_the_activation_that_was_due(
    record: Callable[..., Record],
    experiment: Callable[..., Experiment],
    activation: tuple[float, float, int],
    t_end: float,
    hold: Hold,
    is_active: bool,
) -> None:
    """Only a fault that lasts to the end would have acted again."""
    finished = record(activation=_activation(activation), hazards=(("H1", 4.0),), t_end=t_end)
    stopped = replace(_holding(experiment(), hold), after_hazard=AfterHazard.STOP)
    assert was_active_at_hazard(finished, stopped) == is_active


@pytest.mark.parametrize("limit", [{"where": "x > 1"}, {"call": 2}, {"every": 2}], ids=str)
def test_an_injection_that_affects_only_some_executions_can_pause(
    record: Callable[..., Record], experiment: Callable[..., Experiment], limit: dict[str, Any]
) -> None:
    """Activations before and after the hazard do not show that such a fault acted at the hazard."""
    permanent = _holding(experiment(), Hold.TO_END)
    injections = tuple(replace(injection, **limit) for injection in permanent.fault.injections)
    limited = replace(permanent, fault=replace(permanent.fault, injections=injections))
    finished = record(activation=_activation(LONG), hazards=(("H1", 4.0),))
    assert was_active_at_hazard(finished, permanent)
    assert not was_active_at_hazard(finished, limited)


def _activation(values: tuple[float, float, int] | None) -> ObservedActivation | None:
    if values is None:
        return None
    return ObservedActivation(first=values[0], last=values[1], count=values[2])


def _holding(experiment: Experiment, hold: Hold) -> Experiment:
    return replace(experiment, trigger=replace(experiment.trigger, hold=hold))
