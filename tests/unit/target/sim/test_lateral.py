"""Lateral motion: torque turns the wheel, and the wheel turns the car."""

from math import radians

import pytest
from selfdrive.car.honda.interface import get_params
from selfdrive.sim.lateral import LateralDynamics


@pytest.fixture
def car():
    return LateralDynamics(get_params())


def run(car, seconds, torque, speed, curvature=0.0):
    for _ in range(round(seconds * 100)):
        car.step(torque, speed, curvature)


def hold(car, seconds, angle, speed, curvature=0.0):
    for _ in range(round(seconds * 100)):
        car.steer_angle, car.steer_rate = angle, 0.0
        car._move(speed)


def test_nothing_moves_without_torque(car):
    run(car, 30.0, 0.0, 26.8)
    assert (car.offset, car.heading, car.steer_angle, car.yaw_rate) == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("sign", [1, -1])
def test_torque_to_the_left_gives_positive_motion(car, sign):
    run(car, 1.0, 0.2 * sign, 20.0)
    assert car.steer_angle * sign > 0 and car.yaw_rate * sign > 0
    assert car.heading * sign > 0 and car.offset * sign > 0


def test_sides_are_symmetric():
    left, right = LateralDynamics(get_params()), LateralDynamics(get_params())
    run(left, 2.0, 0.3, 20.0)
    run(right, 2.0, -0.3, 20.0)
    assert (left.offset, left.heading, left.steer_angle) == (
        -right.offset,
        -right.heading,
        -right.steer_angle,
    )


@pytest.mark.parametrize("speed", [1.0, 5.0, 15.0, 26.8, 40.0])
def test_a_steady_turn_agrees_with_the_bicycle_model(car, speed):
    """The yaw rate is v delta / (L (1 + K v^2)), with the understeer gradient K."""
    p = get_params()
    rear = p.wheelbase - p.center_to_front
    understeer = (
        p.mass / p.wheelbase**2 * (rear / p.tire_stiffness_front - p.center_to_front / p.tire_stiffness_rear)
    )
    hold(car, 10.0, radians(10.0), speed)
    expected = speed * radians(10.0) / 13.0 / (p.wheelbase * (1 + understeer * speed**2))
    assert understeer > 0
    assert car.yaw_rate == pytest.approx(expected, rel=1e-6)


def test_full_torque_is_limited_by_the_tyres(car):
    fastest = 0.0
    for _ in range(600):
        car.step(1.0, 26.8, 0.0)
        fastest = max(fastest, car.steer_rate)
    assert 0.3 < fastest <= 0.5
    assert car.yaw_rate * 26.8 == pytest.approx(2.8, abs=0.1)


def test_the_wheel_returns_by_itself(car):
    run(car, 3.0, 0.5, 20.0)
    turned = car.steer_angle
    run(car, 4.0, 0.0, 20.0)
    assert abs(car.steer_angle) < 0.01 * turned


def test_the_wheel_turns_no_further_than_its_stop(car):
    run(car, 30.0, 1.0, 0.0)
    assert (car.steer_angle, car.steer_rate) == (8.7, 0.0)
    run(car, 0.01, -1.0, 0.0)
    assert car.steer_angle < 8.7 and car.steer_rate < 0.0


@pytest.mark.parametrize("speed", [0.0, 0.05, 0.3, 2.0])
def test_slow_driving_is_stable(car, speed):
    run(car, 20.0, 1.0, speed)
    assert abs(car.steer_angle) <= 8.7
    assert abs(car.lateral_speed) <= 2 * speed
    assert abs(car.yaw_rate) <= speed
    if speed == 0.0:
        assert (car.offset, car.heading) == (0.0, 0.0)


def test_a_car_that_goes_straight_leaves_its_lane_in_a_bend(car):
    run(car, 1.0, 0.0, 20.0, curvature=0.002)
    assert car.offset == pytest.approx(-(20.0**2) / 1000, rel=0.02)
    assert car.heading == pytest.approx(-0.04, rel=0.01)
