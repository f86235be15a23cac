"""Unsafe control actions, found by comparing two traces."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mutator.model import Record
from mutator.paper.unsafe_action_detection import (
    RunPair,
    StepFinder,
    build_wrong_time_finder,
    find_brake_too_short,
    find_gas_and_brake_unavailable,
)

T = np.arange(0, 10, 0.1)
NONE = np.zeros_like(T)


def during(begin: float, end: float) -> np.ndarray:
    """Return half of full gas or brake from `begin` until just before `end` (in s), and zero otherwise."""
    return np.where((begin - 0.01 < T) & (end - 0.01 > T), 0.5, 0.0)


def pair(golden: dict[str, np.ndarray], faulty: dict[str, np.ndarray]) -> RunPair:
    """Return two runs, with the activation at 2 s, an alert at 4 s and a hazard at 8 s."""
    none = {"gas": NONE, "brake": NONE}
    return RunPair(
        times_s=T, golden=none | golden, faulty=none | faulty, step_s=0.1, start_s=2.0, end_s=8.0, alert_s=4.0
    )


def stretch(look: StepFinder, given: RunPair) -> tuple[float, float] | None:
    """Return the times of the first and last step that show the action."""
    steps = look(given)
    return None if steps is None else (round(T[steps][0], 1), round(T[steps][-1], 1))


@pytest.mark.parametrize(
    ("end", "shown"),
    [
        (2.0, None),  # no significant braking after the activation
        (3.0, (3.0, 5.9)),  # 1 s of 4 s
        (4.5, None),  # 2.5 s of 4 s
        (6.0, None),  # as long as in the golden run
    ],
)
def test_braking_is_too_short_if_it_lasts_at_most_half_as_long(
    end: float, shown: tuple[float, float] | None
) -> None:
    given = pair({"brake": during(1, 6)}, {"brake": during(1, end)})
    assert stretch(find_brake_too_short, given) == shown


def test_braking_is_not_too_short_if_the_golden_run_does_not_brake() -> None:
    assert find_brake_too_short(pair({}, {})) is None


@pytest.mark.parametrize(
    ("begin", "end", "shown"),
    [
        (5.0, 7.0, (5.0, 6.9)),
        (5.0, 5.4, None),  # only for a moment
        (0.5, 1.9, None),  # before the activation
        (8.1, 9.9, None),  # after the hazard
        (3.0, 4.0, None),  # the golden run applies gas, too
    ],
)
def test_gas_that_the_golden_run_does_not_apply_is_at_a_wrong_time(
    begin: float, end: float, shown: tuple[float, float] | None
) -> None:
    given = pair({"gas": during(3, 4)}, {"gas": during(begin, end)})
    assert stretch(build_wrong_time_finder("gas"), given) == shown
    assert build_wrong_time_finder("brake")(given) is None


BOTH = {"gas": during(5, 7), "brake": during(1, 6)}


@pytest.mark.parametrize(
    ("golden", "last", "shown"),
    [
        (BOTH, 4.5, (4.5, 9.9)),
        (BOTH, 5.5, None),  # more than 1 s after the alert
        ({"brake": during(1, 6)}, 4.5, None),  # the golden run applies no gas
    ],
)
def test_gas_and_brake_are_unavailable_if_they_end_soon_after_the_alert(
    golden: dict[str, np.ndarray], last: float, shown: tuple[float, float] | None
) -> None:
    given = pair(golden, {"brake": during(1, last)})
    assert stretch(find_gas_and_brake_unavailable, given) == shown
    assert find_gas_and_brake_unavailable(replace(given, alert_s=None)) is None


def test_runs_are_compared_up_to_the_end_of_the_shorter_one(record: Callable[..., Record]) -> None:
    found = record(hazards=(("H3", 4.0), ("H1", 5.0)), alerts=(("a", 3.5), ("b", 3.0)))
    long, short = {"t": T, "gas": NONE}, {"t": T[:70], "gas": NONE[:70]}
    for golden, faulty in ((long, short), (short, long)):
        whole = RunPair.of(golden, faulty, found, "t", 0.1, None)
        assert {len(whole.times_s), len(whole.golden["gas"]), len(whole.faulty["gas"])} == {70}
        assert (whole.start_s, whole.end_s, whole.alert_s) == (2.0, T[69], 3.5)
        assert RunPair.of(golden, faulty, found, "t", 0.1, "H1").end_s == 5.0
