"""Limits of acceleration, by hand: 3.6 m/s^3 of jerk at 4.5 m/s^3 for each torque leave 0.8 of torque."""

from collections.abc import Callable
from typing import Any

import pytest

Build = Callable[..., Any]


@pytest.fixture
def limits(model: Build) -> Any:
    return model(lateral_acceleration_limit=3.6, lateral_jerk_limit=3.6)


def ranges(limits: Any, **sensed: float) -> Any:
    straight = {"holding_torque": 0.0, "jerk_per_torque": 4.5, "lateral_acceleration": 0.0}
    return limits.update(0.0, {"highest_gas": 0.2, "highest_brake": 1.1} | straight | sensed, {})


def test_pedals_have_an_upper_limit(limits: Any) -> None:
    assert ranges(limits)["gas"] == (float("-inf"), 0.2)
    assert ranges(limits)["brake"] == (float("-inf"), 1.1)


def test_the_torque_may_turn_the_wheel_as_fast_as_the_jerk_allows(limits: Any) -> None:
    assert ranges(limits)["steer"] == pytest.approx((-0.8, 0.8))
    assert ranges(limits, holding_torque=0.5)["steer"] == pytest.approx((-0.3, 1.3))


@pytest.mark.parametrize(
    ("acceleration", "expected"), [(3.6, (0.1, 0.9)), (-3.6, (0.9, 1.7)), (3.5, (0.1, 1.7))]
)
def test_at_the_limit_the_wheel_only_comes_back(
    limits: Any, acceleration: float, expected: tuple[float, float]
) -> None:
    steer = ranges(limits, lateral_acceleration=acceleration, holding_torque=0.9)["steer"]
    assert steer == pytest.approx(expected)


def test_at_rest_the_torque_is_free(limits: Any) -> None:
    assert ranges(limits, jerk_per_torque=0.0)["steer"] == (float("-inf"), float("inf"))


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
@pytest.mark.parametrize("name", ["highest_gas", "holding_torque", "jerk_per_torque", "lateral_acceleration"])
def test_every_bound_is_a_number_whatever_is_sensed(limits: Any, name: str, value: float) -> None:
    """A fault in what is sensed does not end the run: the runtime refuses a range without numbers."""
    for low, high in ranges(limits, **{name: value}).values():
        assert float("-inf") <= low < float("inf") and float("-inf") < high <= float("inf") and low <= high
