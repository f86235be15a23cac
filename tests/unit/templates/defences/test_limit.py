"""A limit keeps commands in their range and limits how fast they change."""

from collections.abc import Callable
from typing import Any

import pytest

Build = Callable[..., Any]


def test_a_range_is_the_same_in_each_step(model: Build) -> None:
    limit = model(lowest_gas=0.1, highest_gas=0.4, highest_brake=0.5)
    for since_s in (0.0, 0.01, 7.0):
        ranges = limit.update(since_s, {}, {"gas": 0.2, "brake": 0.0})
        assert ranges == {"gas": (0.1, 0.4), "brake": (float("-inf"), 0.5)}


def test_a_rate_limits_the_change_from_the_step_before(model: Build) -> None:
    """2 per second are 0.2 in a step of 0.1 s; the first step has none before it."""
    limit = model(rate_steer=2.0)
    assert limit.update(0.0, {}, {"steer": 0.3})["steer"] == (float("-inf"), float("inf"))
    assert limit.update(0.1, {}, {"steer": 0.3})["steer"] == pytest.approx((0.1, 0.5))
    assert limit.update(0.2, {}, {"steer": 0.5})["steer"] == pytest.approx((0.3, 0.7))


def test_the_range_cuts_what_the_rate_allows(model: Build) -> None:
    limit = model(rate_steer=2.0, highest_steer=0.4)
    limit.update(0.0, {}, {"steer": 0.3})
    assert limit.update(0.1, {}, {"steer": 0.3})["steer"] == pytest.approx((0.1, 0.4))


@pytest.mark.parametrize(("before", "expected"), [(1.0, (0.8, 0.8)), (-1.0, (-0.8, -0.8))])
def test_a_value_outside_of_the_range_comes_back_at_the_rate(
    model: Build, before: float, expected: tuple[float, float]
) -> None:
    limit = model(rate_steer=2.0, lowest_steer=-0.4, highest_steer=0.4)
    limit.update(0.0, {}, {"steer": before})
    assert limit.update(0.1, {}, {"steer": before})["steer"] == pytest.approx(expected)


def test_after_a_reset_the_first_step_has_none_before_it(model: Build) -> None:
    limit = model(rate_steer=2.0)
    limit.update(0.0, {}, {"steer": 0.0})
    limit.reset()
    assert limit.update(0.0, {}, {"steer": 0.0})["steer"] == (float("-inf"), float("inf"))
