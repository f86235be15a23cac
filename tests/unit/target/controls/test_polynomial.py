"""Cubics and their fit."""

import pytest
from selfdrive.controls.lib.polynomial import ZERO, CubicFit, blend, shifted, slope, value

CURVE = (1e-5, -2e-3, 0.05, 1.85)


def test_fit_finds_the_cubic() -> None:
    """Points on a cubic give its coefficients back."""
    assert CubicFit()([value(CURVE, x) for x in range(50)]) == pytest.approx(CURVE, rel=1e-9)


def test_fit_is_least_squares() -> None:
    """The residuals of a fit are orthogonal to all powers up to three."""
    points = [((7 * x) % 11) / 10.0 for x in range(50)]
    curve = CubicFit()(points)
    for power in range(4):
        assert sum((y - value(curve, x)) * x**power for x, y in enumerate(points)) == pytest.approx(
            0, abs=1e-6
        )


def test_slope() -> None:
    """The slope is the derivative."""
    assert slope(CURVE, 20.0) == pytest.approx((value(CURVE, 20.001) - value(CURVE, 19.999)) / 0.002)


def test_shift_and_blend() -> None:
    """A curve is moved sideways; a blend is the weighted mean, and zero without weight."""
    assert value(shifted(CURVE, 0.5), 30.0) == pytest.approx(value(CURVE, 30.0) + 0.5)
    assert value(blend(CURVE, 3.0, ZERO, 1.0), 10.0) == pytest.approx(0.75 * value(CURVE, 10.0))
    assert blend(CURVE, 0.0, CURVE, 0.0) == ZERO
