"""The smallest form on made-up hazards: functions from a form to the time of its hazard."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mutator.explore.fault_forms import Axis, FaultForm, FormResult, FormSpace, SizeAxis
from mutator.explore.round_numbers import RoundNumbers
from mutator.explore.shrinking import Shrinking

STEP_S, START_S, END_S = 0.01, 5.0, 30.0
ORIGINAL = FaultForm(scenario="S5", size=187.0)
MakeHazard = Callable[[FaultForm], float | None]


def space(hazard_s: float, **changes: Any) -> FormSpace:
    """A fault of 187 from 5 s to the end of the drive, whose hazard came at `hazard_s`."""
    plain = FormSpace(
        original=ORIGINAL,
        hazard_s=hazard_s,
        start_s=START_S,
        last_active_s=END_S,
        end_s=END_S,
        longest_s=END_S - START_S,
        can_start_at_time=True,
        scenarios=(),
        start_in=lambda scenario: START_S,
        injection_count=1,
        sizes=SizeAxis(largest=187.0, numbers=RoundNumbers(least=1.0, step=1.0)),
        step_s=STEP_S,
        durations=RoundNumbers(least=STEP_S, step=STEP_S),
    )
    return replace(plain, **changes)


def shrink(form_space: FormSpace, hazard: MakeHazard) -> Shrinking:
    """Run a search to its end."""
    shrinking = Shrinking(form_space)
    proposals = shrinking.proposals()
    batch = next(proposals, None)
    while batch is not None:
        assert not set(batch) & set(shrinking.results)  # nothing is driven twice
        results = {form: FormResult(experiment_id="", hazard_s=hazard(form), ending="") for form in batch}
        try:
            batch = proposals.send(results)
        except StopIteration:
            batch = None
    return shrinking


def check_minimal(shrinking: Shrinking) -> None:
    """The smallest form has the hazard; the next shorter and the next smaller one were driven, without it."""
    assert shrinking.hazard_s(shrinking.smallest) is not None
    for axis in Axis:
        if neighbour := shrinking.neighbour(shrinking.smallest, axis):
            assert shrinking.results[neighbour].hazard_s is None


def reaches(size: float, duration_s: float, after_s: float = 3.0) -> MakeHazard:
    """A hazard that comes `after_s` after the start of any fault at least so large and long."""

    def hazard_s(form: FaultForm) -> float | None:
        lasts_s = END_S if form.duration_s is None else form.duration_s
        is_enough = (form.size or 0.0) >= size and lasts_s >= duration_s
        return (form.start_s or START_S) + after_s if is_enough else None

    return hazard_s


def test_a_fault_is_first_shortened_to_its_hazard() -> None:
    """What follows the hazard cannot have caused it. Two steps of margin, rounded up to two digits."""
    shrinking = shrink(space(8.456), reaches(0.0, 3.4))
    assert shrinking.steps[0].what == "duration"
    assert shrinking.steps[0].form == replace(ORIGINAL, start_s=5.0, duration_s=3.5)


@pytest.mark.parametrize(("size", "duration_s"), [(18, 0.04), (101, 3.0), (187, 0.01), (1, 2.4), (20, 1.0)])
def test_the_result_is_the_smallest_where_more_is_worse(size: int, duration_s: float) -> None:
    """Both numbers are the smallest of two digits that reach the hazard, after few runs."""
    shrinking = shrink(space(8.0), reaches(size, duration_s))
    numbers = RoundNumbers(least=1.0, step=1.0)
    assert shrinking.smallest.size == (187.0 if size == 187 else numbers.at_least(size))
    assert shrinking.smallest.duration_s == duration_s
    assert len(shrinking.results) <= 30
    check_minimal(shrinking)


@pytest.mark.parametrize("seed", range(60))
def test_no_smaller_neighbour_has_the_hazard_whatever_the_hazard_does(seed: int) -> None:
    """Hazards with islands in size and duration, some of them after the end of the fault: minimal, no form is
    larger than the original, and the same search again proposes the same.
    """
    made_up = np.random.Generator(np.random.PCG64(seed))
    waves, phases = made_up.uniform(0.5, 9.0, 4), made_up.uniform(0.0, 6.0, 4)
    share = made_up.uniform(-0.8, 0.9)

    def hazard_s(form: FaultForm) -> float | None:
        at = (
            np.log(form.size or 1.0),
            np.log((form.duration_s or END_S) / STEP_S),
            np.log(form.size or 1.0),
            0.0,
        )
        height = float(np.mean([np.sin(w * x + p) for w, x, p in zip(waves, at, phases, strict=True)]))
        is_first = form.duration_s == 3.1 and form.size == 187.0
        return START_S + 3.0 + height if height > share or is_first else None

    first, again = (shrink(space(8.0), hazard_s) for _ in range(2))
    check_minimal(first)
    assert all(form.size and form.size <= 187.0 for form in first.results)
    assert (first.smallest, list(first.results)) == (again.smallest, list(again.results))


def test_a_glitch_after_whose_end_the_hazard_comes_is_shortened_further() -> None:
    """Causality says nothing here, so durations are driven."""
    shrinking = shrink(space(12.0, longest_s=2.0, last_active_s=7.0), reaches(60, 0.02, after_s=7.0))
    assert shrinking.smallest == FaultForm(scenario="S5", size=60.0, start_s=5.0, duration_s=0.02)
    check_minimal(shrinking)


def test_the_simplest_scenario_with_the_hazard_is_chosen() -> None:
    """Those before it have no hazard; where the fault never begins, nothing is driven."""
    starts = {"S1": 4.0, "S2": None, "S3": 6.0, "S4": 7.0}

    def hazard_s(form: FaultForm) -> float | None:
        return None if form.scenario == "S1" else reaches(100, 1.0)(form)

    shrinking = shrink(space(8.0, scenarios=tuple(starts), start_in=starts.__getitem__), hazard_s)
    assert (shrinking.smallest.scenario, shrinking.smallest.start_s) == ("S3", 6.0)
    assert "S2" not in {form.scenario for form in shrinking.results}
    check_minimal(shrinking)


def test_one_injection_remains_if_one_alone_reaches_the_hazard() -> None:
    """The first such one; all of them remain if none does."""

    def alone(number: int | None) -> MakeHazard:
        return lambda form: reaches(50, 1.0)(form) if form.injection in (None, number) else None

    assert shrink(space(8.0, injection_count=3), alone(1)).smallest.injection == 1
    assert shrink(space(8.0, injection_count=3), alone(None)).smallest.injection is None


def test_the_start_is_changed_only_if_asked_to() -> None:
    """Then the fewest digits with which the hazard comes."""

    def hazard_s(form: FaultForm) -> float | None:
        return reaches(50, 1.0)(form) if form.start_s in (7.43, 7.4) else None

    asked = space(10.43, start_s=7.43, changes_start=True)
    assert shrink(asked, hazard_s).smallest.start_s == 7.4
    assert shrink(replace(asked, changes_start=False), hazard_s).smallest.start_s == 7.43


def test_a_fault_that_needs_its_breaks_keeps_its_trigger() -> None:
    """If no fault without a break has the hazard, its value still becomes smaller, and a note says so."""

    def hazard_s(form: FaultForm) -> float | None:
        return 8.0 if form.start_s is None and (form.size or 0.0) >= 33 else None

    shrinking = shrink(space(8.0), hazard_s)
    assert shrinking.smallest == replace(ORIGINAL, size=33.0)
    assert "keeps its trigger" in shrinking.notes[0]
    check_minimal(shrinking)


def test_a_spec_that_declares_the_hold_keeps_it() -> None:
    """To the end: the fault gets a start and no duration. While its condition holds: it keeps its trigger."""
    to_end = shrink(space(8.0, longest_s=None), reaches(50, 0.0))
    assert to_end.smallest == replace(ORIGINAL, size=50.0, start_s=5.0)
    while_it_holds = shrink(space(8.0, longest_s=None, can_start_at_time=False), reaches(50, 0.0))
    assert while_it_holds.smallest == replace(ORIGINAL, size=50.0)


def test_a_fault_without_a_value_is_only_shortened() -> None:
    """It has no size, and no neighbour on that axis."""
    plain = FaultForm(scenario="S5")
    shrinking = shrink(space(8.0, original=plain, sizes=None), reaches(0.0, 0.7))
    assert shrinking.smallest == replace(plain, start_s=5.0, duration_s=0.7)
    assert shrinking.neighbour(shrinking.smallest, Axis.SIZE) is None


def test_listed_values_are_simpler_the_earlier_they_are_listed() -> None:
    """The size is the place in the list, whose last value is the fault's."""
    sizes = SizeAxis(
        largest=60.0, numbers=RoundNumbers(least=1.0, step=1.0), values=(800.0, 400.0, 200.0, 60.0)
    )
    original = replace(ORIGINAL, size=sizes.largest_size)
    shrinking = shrink(space(8.0, original=original, sizes=sizes), reaches(2.0, 1.0))
    assert shrinking.smallest.size == 2.0
    assert sizes.value(2.0) == 400.0
    check_minimal(shrinking)


def test_the_sign_of_a_value_stays() -> None:
    """A size is an absolute value."""
    assert SizeAxis(largest=-11.02, numbers=RoundNumbers(least=0.01)).value(5.0) == -5.0
