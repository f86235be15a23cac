"""Three stages of braking: at 20 m/s, the later two begin below 20/5.8 = 3.45 s and 20/9.8 = 2.04 s."""

from collections.abc import Callable
from typing import Any

import pytest

Build = Callable[..., Any]


@pytest.fixture
def braking(model: Build) -> Any:
    return model(stops_at_2=5.8, stops_at_3=9.8, deceleration_1=8.1, deceleration_2=8.55, deceleration_3=9.0)


def deceleration(braking: Any, ttc: float, v_ego: float = 20.0) -> float:
    ranges = braking.update(0.0, {"ttc": ttc, "v_ego": v_ego}, {})
    assert ranges["gas"] == (float("-inf"), 0.0)
    lowest, highest = ranges["deceleration"]
    assert highest == float("inf")
    return float(lowest)


@pytest.mark.parametrize(
    ("ttc", "expected"), [(5.0, 8.1), (3.45, 8.1), (3.44, 8.55), (2.05, 8.55), (2.04, 9.0), (0.0, 9.0)]
)
def test_each_stage_begins_at_its_time_to_collision(braking: Any, ttc: float, expected: float) -> None:
    assert deceleration(braking, ttc) == expected


def test_a_stage_is_kept_until_the_reset(braking: Any) -> None:
    assert [deceleration(braking, ttc) for ttc in (3.0, 5.0, 1.0, 5.0)] == [8.55, 8.55, 9.0, 9.0]
    braking.reset()
    assert deceleration(braking, 5.0) == 8.1


def test_the_thresholds_follow_the_speed(braking: Any) -> None:
    """At 10 m/s, the second stage begins below 1.72 s."""
    assert deceleration(braking, 2.0, 10.0) == 8.1
    assert deceleration(braking, 1.7, 10.0) == 8.55
