"""Distance of an object from the car's predicted path."""

from math import cos, hypot, pi, sin

import pytest
from selfdrive.controls.lib.predicted_path import distance_to, model_curve, steering_curve


def test_distance_from_a_straight_path() -> None:
    straight = steering_curve(0.0)
    assert distance_to(straight, 50.0, 1.2) == pytest.approx(1.2)
    assert distance_to(straight, 50.0, -1.2) == pytest.approx(-1.2)
    assert distance_to(straight, 50.0, 0.0) == 0.0


def test_distance_from_a_slanting_path() -> None:
    assert distance_to(model_curve((0.0, 0.0, 1.0, 0.0)), 20.0, 0.0) == pytest.approx(-20.0 / 2**0.5)


@pytest.mark.parametrize("angle", [0.1, 0.3])
@pytest.mark.parametrize("offset", [-1.0, 0.5])
def test_distance_from_a_steering_circle(angle: float, offset: float) -> None:
    radius = 200.0
    x, y = (radius - offset) * sin(angle), radius - (radius - offset) * cos(angle)
    assert distance_to(steering_curve(1.0 / radius), x, y) == pytest.approx(offset, abs=1e-3)
    assert distance_to(steering_curve(-1.0 / radius), x, -y) == pytest.approx(-offset, abs=1e-3)


def test_model_curve_agrees_with_a_search() -> None:
    poly = (1e-5, -5e-4, 0.02, 0.3)
    curve = model_curve(poly)
    best = min(hypot(x / 100.0 - 40.0, curve(x / 100.0)[0] - 3.0) for x in range(14000))
    assert distance_to(curve, 40.0, 3.0) == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("side", [1, -1])
def test_sharp_steering_stays_finite(side: int) -> None:
    assert abs(distance_to(steering_curve(0.1 * side), 100.0, 0.0)) < 2000.0 * pi
