"""Speed profiles under limits of acceleration and jerk."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from selfdrive.controls.lib.speed_smoother import Limits, smooth_speed

LIMITS = Limits(a_min=-1.0, a_max=1.0, j_min=-1.0, j_max=1.0)


def drive(v: float, a: float, target: float, steps: int, limits: Limits = LIMITS, dt: float = 0.05) -> list:
    path = []
    for _ in range(steps):
        v, a = smooth_speed(v, a, target, limits, dt)
        path.append((v, a))
    return path


def test_from_constant_speed_acceleration_changes_at_the_jerk_limit() -> None:
    assert smooth_speed(20.0, 0.0, 25.0, LIMITS, 0.2) == pytest.approx((20.02, 0.2))
    assert smooth_speed(20.0, 0.0, 15.0, LIMITS, 0.2) == pytest.approx((19.98, -0.2))


def test_away_from_the_target_the_jerk_limit_is_three_times_as_high() -> None:
    _, a = smooth_speed(20.0, -0.5, 25.0, LIMITS, 0.1)
    assert a == pytest.approx(-0.2)


def test_an_acceleration_above_its_limit_returns_at_the_jerk_limit() -> None:
    assert smooth_speed(20.0, 1.5, 40.0, LIMITS, 0.2)[1] == pytest.approx(1.3)
    assert smooth_speed(20.0, 1.1, 40.0, LIMITS, 0.5)[1] == pytest.approx(1.0)


@given(
    v=st.floats(0.0, 40.0),
    a=st.floats(-1.0, 1.0),
    target=st.floats(0.0, 40.0),
)
def test_the_target_is_reached_within_the_limits(v: float, a: float, target: float) -> None:
    before, path = a, drive(v, a, target, 1200)
    for _, now in path:
        assert -1.0 - 1e-6 <= now <= 1.0 + 1e-6
        assert abs(now - before) <= 3.0 * 0.05 + 1e-6
        before = now
    assert path[-1][0] == pytest.approx(target, abs=1e-3)
    assert path[-1][1] == pytest.approx(0.0, abs=1e-2)


@given(
    v=st.floats(0.0, 40.0),
    a=st.floats(0.0, 1.0),
    gain=st.floats(1.0, 20.0),
    side=st.sampled_from((1, -1)),
    once=st.floats(0.01, 30.0),
)
def test_many_small_steps_follow_the_profile_of_one_large_step(
    v: float, a: float, gain: float, side: int, once: float
) -> None:
    limits = Limits(a_min=-0.8, a_max=0.8, j_min=-0.7, j_max=0.7)
    v_far, a_far = smooth_speed(v, side * a, v + side * gain, limits, once)
    (v_near, a_near), *_ = reversed(drive(v, side * a, v + side * gain, 200, limits, once / 200))
    assert v_near == pytest.approx(v_far, abs=1e-3)
    assert a_near == pytest.approx(a_far, abs=1e-2)


def test_a_negative_upper_limit_slows_the_car_despite_a_higher_target() -> None:
    v, a = drive(20.0, 0.0, 30.0, 100, Limits(-0.5, -0.2, -0.5, 0.5))[-1]
    assert a == pytest.approx(-0.2) and v == pytest.approx(19.02, abs=0.05)
