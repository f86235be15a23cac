"""Steering between two solutions of the lateral MPC."""

import pytest
from selfdrive.car.params import CarParams
from selfdrive.common.conversions import DEG_TO_RAD
from selfdrive.controls.lib.latcontrol import LatControl
from selfdrive.controls.lib.lateral_mpc import Lanes
from selfdrive.controls.lib.polynomial import ZERO
from selfdrive.messages import CarState

LANES = Lanes(ZERO, ZERO, ZERO, 1.0, 1.0, 3.7)


class FixedMpc:
    """Wants the angles it is told to, one after the other."""

    def __init__(self, *degrees: float) -> None:
        self.angles = [d * DEG_TO_RAD for d in degrees]

    def update(self, *_) -> float:
        return self.angles.pop(0)


def control(params: CarParams, *degrees: float, v_ego: float = 20.0) -> tuple[LatControl, CarState]:
    lateral = LatControl(params)
    lateral.mpc = FixedMpc(*degrees)
    car = CarState(v_ego=v_ego)
    for k in range(len(degrees)):
        lateral.plan(k * 0.05, car, LANES, 0.0)
    return lateral, car


def test_wanted_angle_is_interpolated_and_not_held_back(params: CarParams) -> None:
    """From one solution to the next the angle moves in 50 ms, and at most 70 ms when a message is late."""
    lateral, car = control(params, 0.0, 1.0)
    degrees = []
    for k in range(10):
        lateral.update(0.05 + k * 0.01, car, True)
        degrees.append(lateral.angle_desired / DEG_TO_RAD)
    assert degrees == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.4, 1.4, 1.4])


def test_torque_is_that_of_the_degree_gains(params: CarParams) -> None:
    """An error of one degree gives 0.8 of torque, and 0.24 more each second."""
    lateral, car = control(params, 1.0, 1.0)
    assert lateral.update(0.09, car, True) == pytest.approx(0.8 + 0.0024)


def test_driver_at_the_wheel_is_not_worked_against(params: CarParams) -> None:
    """While the driver steers, the integral does not grow and no saturation is told."""
    lateral, _ = control(params, 5.0, 5.0)
    car = CarState(v_ego=20.0, steering_pressed=True)
    for k in range(100):
        lateral.update(0.05 + k * 0.01, car, True)
    assert not lateral.saturated
    lateral.mpc.angles = [0.0, 0.0]
    lateral.plan(1.1, car, LANES, 0.0)
    lateral.plan(1.15, car, LANES, 0.0)
    assert lateral.update(1.15, car, True) == 0.0


@pytest.mark.parametrize(("v_ego", "active"), [(0.29, True), (20.0, False)])
def test_no_torque_at_rest_or_out_of_control(params: CarParams, v_ego: float, active: bool) -> None:
    """Nearly at rest and out of control there is no torque and no history."""
    lateral, car = control(params, 1.0, 1.0, v_ego=v_ego)
    assert lateral.update(0.05, car, active) == 0.0
    assert not lateral.saturated


@pytest.mark.parametrize(
    ("v_ego", "degrees", "told"), [(10.1, 5.0, True), (10.0, 5.0, False), (20.0, 0.5, False)]
)
def test_saturation_is_told_above_10_mps(params: CarParams, v_ego: float, degrees: float, told: bool) -> None:
    """More than 0.8 s beyond full torque is told, faster than 10 m/s only."""
    lateral, car = control(params, degrees, degrees, v_ego=v_ego)
    for k in range(85):
        lateral.update(0.05 + k * 0.01, car, True)
    assert lateral.saturated is told
