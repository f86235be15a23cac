"""Lateral control steers towards the angle that the lateral MPC plans."""

from dataclasses import replace
from math import nan

import pytest
from selfdrive.common.car import CarParams
from selfdrive.common.conversions import DEG_TO_RAD
from selfdrive.controls.lib.latcontrol import LatControl
from selfdrive.controls.lib.lateral_mpc import Lanes
from selfdrive.controls.lib.polynomial import ZERO
from selfdrive.messages import CarState

LANES = Lanes(ZERO, ZERO, ZERO, 1.0, 1.0, 3.7)


class FixedMpc:
    def __init__(self, *degrees: float) -> None:
        self.angles = [d * DEG_TO_RAD for d in degrees]

    def update(self, *_) -> float:
        return self.angles.pop(0)


def control(params: CarParams, *degrees: float, v_ego: float = 20.0) -> tuple[LatControl, CarState]:
    lateral = LatControl(params)
    lateral.mpc = FixedMpc(*degrees)
    car = CarState(v_ego=v_ego)
    lateral.plan(car, LANES, 0.0)
    return lateral, car


def test_the_desired_angle_is_held_until_the_next_plan(params: CarParams) -> None:
    lateral, car = control(params, 0.5, 1.0)
    held = []
    for k in range(10):
        if k == 5:
            lateral.plan(car, LANES, 0.0)
        lateral.update(car, True)
        held.append(lateral.angle_desired / DEG_TO_RAD)
    assert held == pytest.approx([0.5] * 5 + [1.0] * 5)


def test_torque_follows_the_gains_per_degree(params: CarParams) -> None:
    lateral, car = control(params, 1.0, v_ego=0.3)
    assert lateral.update(car, True) == pytest.approx(0.8 + 0.0024, abs=1e-5)
    assert lateral.update(car, True) == pytest.approx(0.8 + 0.0048, abs=1e-5)


def test_feedforward_grows_with_lateral_acceleration(params: CarParams) -> None:
    """As in the original, this car has none."""
    for v_ego in (10.0, 30.0):
        for tuned, torque in (
            (params, 0.0),
            (replace(params, steer_kf=0.003), -0.006 * DEG_TO_RAD * v_ego**2),
        ):
            lateral, _ = control(tuned, -2.0)
            car = CarState(v_ego=v_ego, steering_angle=lateral.angle_desired)
            assert lateral.update(car, True) == pytest.approx(torque)


def test_a_nan_angle_gives_full_torque_to_the_left(params: CarParams) -> None:
    """The angle is NaN if the MPC has no solution."""
    lateral, car = control(params, nan, 1.0)
    assert [lateral.update(car, True) for _ in range(100)] == [1.0] * 100
    assert not lateral.saturated
    lateral.plan(car, LANES, 0.0)
    fresh, _ = control(params, 1.0)
    assert lateral.update(car, True) == fresh.update(car, True)


def test_control_does_not_work_against_the_driver(params: CarParams) -> None:
    lateral, _ = control(params, 5.0, 0.0)
    car = CarState(v_ego=20.0, steering_pressed=True)
    for _ in range(100):
        lateral.update(car, True)
    assert not lateral.saturated
    lateral.plan(car, LANES, 0.0)
    assert lateral.update(car, True) == 0.0


@pytest.mark.parametrize(("v_ego", "active"), [(0.29, True), (20.0, False)])
def test_there_is_no_torque_at_rest_or_while_disengaged(
    params: CarParams, v_ego: float, active: bool
) -> None:
    lateral, car = control(params, 1.0)
    first, *_ = [lateral.update(car, True) for _ in range(100)]
    assert lateral.update(CarState(v_ego=v_ego), active) == 0.0
    assert lateral.update(car, True) == first


@pytest.mark.parametrize(
    ("v_ego", "degrees", "told"), [(10.1, 5.0, True), (10.0, 5.0, False), (20.0, 0.5, False)]
)
def test_saturation_is_reported_only_above_10_mps(
    params: CarParams, v_ego: float, degrees: float, told: bool
) -> None:
    lateral, car = control(params, degrees, v_ego=v_ego)
    for _ in range(85):
        lateral.update(car, True)
    assert lateral.saturated is told
