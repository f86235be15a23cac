"""A driver reacts after 2.5 s; 1.2 s later, the brake is half pressed."""

from collections.abc import Callable
from math import exp
from typing import Any

import pytest

Build = Callable[..., Any]
DRIVER = {"reaction_s": 2.5, "half_s": 1.2, "steepness": 10.0, "full_deceleration": 9.0}


@pytest.mark.parametrize("since_s", [0.0, 1.0, 2.49])
def test_the_driver_does_nothing_before_reacting(model: Build, since_s: float) -> None:
    assert model(**DRIVER).update(since_s, {}, {}) == {}


@pytest.mark.parametrize("after_s", [0.0, 0.6, 1.2, 1.8, 60.0])
def test_the_brake_rises_as_in_the_source(model: Build, after_s: float) -> None:
    """It says e^(10 t - 12) / (1 + e^(10 t - 12)), with t in s from the reaction."""
    power = exp(10.0 * after_s - 12.0)
    lowest, highest = model(**DRIVER).update(2.5 + after_s, {}, {})["deceleration"]
    assert lowest == pytest.approx(9.0 * power / (1.0 + power))
    assert highest == float("inf")


def test_the_driver_gives_no_gas(model: Build) -> None:
    assert model(**DRIVER).update(3.0, {}, {})["gas"] == (float("-inf"), 0.0)


@pytest.mark.parametrize(("presses", "pedal"), [(0.0, None), (1.0, (1.0, 1.0))])
def test_a_pressed_pedal_is_a_command(model: Build, presses: float, pedal: Any) -> None:
    driver = model(**DRIVER, presses_pedal=presses)
    assert driver.update(2.6, {}, {}).get("brake_pedal") == pedal
    assert driver.update(2.4, {}, {}) == {}


def test_a_steep_curve_is_a_step(model: Build) -> None:
    driver = model(**DRIVER | {"steepness": 1e6})
    assert driver.update(2.6, {}, {})["deceleration"][0] == 0.0
    assert driver.update(4.0, {}, {})["deceleration"][0] == 9.0
