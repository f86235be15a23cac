"""The PI controller with feedforward, limits and saturation check."""

import pytest
from selfdrive.controls.lib.pid import PIController


def make(kp: float = 1.0, ki: float = 1.0, **options) -> PIController:
    return PIController(((0.0,), (kp,)), ((0.0,), (ki,)), **options)


def test_the_output_is_the_sum_of_three_terms() -> None:
    pid = make(kp=0.2, ki=0.5)
    assert pid.update(1.0, 0.0, speed=0.0, feedforward=0.1) == pytest.approx(0.2 + 0.005 + 0.1)


def test_gains_are_interpolated_over_speed() -> None:
    pid = PIController(((0.0, 10.0), (1.0, 0.5)), ((0.0,), (0.0,)))
    assert pid.update(0.4, 0.0, speed=5.0) == pytest.approx(0.3)


def test_the_integral_stops_at_a_limit_and_leaves_it_at_once() -> None:
    pid = make()
    for _ in range(500):
        pid.update(3.0, 0.0, speed=0.0)
    assert pid.i == 0.0
    pid.update(-0.5, 0.0, speed=0.0)
    assert pid.i == pytest.approx(-0.005)


@pytest.mark.parametrize("side", [1, -1])
def test_at_a_limit_the_integral_can_still_move_towards_zero(side: int) -> None:
    pid = make()
    pid.i = -0.5 * side
    pid.update(3.0 * side, 0.0, speed=0.0)
    assert pid.i == pytest.approx(-0.47 * side)


def test_limits_apply_after_conversion() -> None:
    pid = make(convert=lambda control, speed: control / 10.0)
    assert pid.update(5.0, 0.0, speed=0.0) == pytest.approx(0.505)
    assert pid.i > 0.0
    assert pid.update(50.0, 0.0, speed=0.0) == 1.0


def test_driver_override_unwinds_the_integral() -> None:
    pid = make()
    pid.i = -0.3
    for _ in range(50):
        pid.update(1.0, 0.0, speed=0.0, override=True)
    assert pid.i == pytest.approx(-0.15)


def saturate(cycles: int, error: float = 2.0, **options) -> PIController:
    pid = make(kp=1.0, ki=0.0)
    if error < 1.0:
        pid.pos_limit = error / 2.0
    for _ in range(cycles):
        pid.update(error, 0.0, speed=0.0, **options)
    return pid


def test_saturation_is_reported_after_more_than_800_ms() -> None:
    assert not saturate(79).saturated
    assert saturate(82).saturated


def test_a_small_error_an_override_or_a_disabled_check_prevents_saturation() -> None:
    assert not saturate(200, error=0.09).saturated
    assert saturate(200, error=0.11).saturated
    assert not saturate(200, override=True).saturated
    assert not saturate(200, check_saturation=False).saturated


def test_the_saturation_count_falls_as_fast_as_it_rises() -> None:
    pid = saturate(300)
    for _ in range(10):
        pid.update(0.0, 0.0, speed=0.0)
    assert pid.saturated
    for _ in range(15):
        pid.update(0.0, 0.0, speed=0.0)
    assert not pid.saturated


def test_reset_clears_integral_and_saturation() -> None:
    pid = saturate(200)
    pid.i = 1.0
    pid.reset()
    assert (pid.i, pid.saturated) == (0.0, False)
