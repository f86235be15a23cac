"""Cubic polynomials and their least-squares fit."""

import math
import random
from pathlib import Path

import pytest
from selfdrive.common import compiled
from selfdrive.controls.lib.compiled_fit import CompiledFit, build_fit
from selfdrive.controls.lib.cubic_fit import CubicFit
from selfdrive.controls.lib.polynomial import ZERO, blend, shifted, slope, value
from selfdrive.sim.compile_helpers import compiler_command

CURVE = (1e-5, -2e-3, 0.05, 1.85)


def test_fit_recovers_a_cubic() -> None:
    assert CubicFit()([value(CURVE, x) for x in range(50)]) == pytest.approx(CURVE, rel=1e-9)


def test_fit_is_least_squares() -> None:
    """The residuals of a fit are orthogonal to all powers up to three."""
    points = [((7 * x) % 11) / 10.0 for x in range(50)]
    curve = CubicFit()(points)
    for power in range(4):
        assert sum((y - value(curve, x)) * x**power for x, y in enumerate(points)) == pytest.approx(
            0, abs=1e-6
        )


@pytest.mark.skipif(not compiler_command(), reason="there is no C compiler")
def test_a_compiled_fit_has_the_same_bits(all_compiled: Path) -> None:
    compiled.use_libraries_in(all_compiled)
    fast = build_fit()
    compiled.use_libraries_in(None)
    assert isinstance(fast, CompiledFit) and type(build_fit()) is CubicFit
    draw = random.Random(3)
    cases: list[list[float]] = [[draw.gauss(0.0, 10.0**size) for _ in range(50)] for size in range(-3, 12)]
    cases += [[0.0] * 50, [-0.0] * 50, list(range(50)), cases[0][:7], [*cases[0], 1.0], []]
    cases += [[*cases[0][:20], odd, *cases[0][21:]] for odd in (math.inf, 1e308, 10**400)]
    for points in cases:
        try:
            wanted = repr(CubicFit()(points))
        except OverflowError as error:
            with pytest.raises(OverflowError, match=str(error)):
                fast(points)
        else:
            assert repr(fast(points)) == wanted
    with pytest.raises(TypeError, match="unsupported operand"):
        fast([*cases[0][:20], None])  # type: ignore[list-item]


def test_slope_of_a_curve() -> None:
    assert slope(CURVE, 20.0) == pytest.approx((value(CURVE, 20.001) - value(CURVE, 19.999)) / 0.002)


def test_shift_and_blend() -> None:
    assert value(shifted(CURVE, 0.5), 30.0) == pytest.approx(value(CURVE, 30.0) + 0.5)
    assert value(blend(CURVE, 3.0, ZERO, 1.0), 10.0) == pytest.approx(0.75 * value(CURVE, 10.0))
    assert blend(CURVE, 0.0, CURVE, 0.0) == ZERO
