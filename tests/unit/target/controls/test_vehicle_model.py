"""Steady-state bicycle model."""

import pytest
from selfdrive.car.params import CarParams
from selfdrive.controls.lib.vehicle_model import VehicleModel


def test_standing_it_is_geometry(params: CarParams) -> None:
    """Near standstill, curvature is the road-wheel angle over the wheelbase."""
    assert VehicleModel(params).curvature(1.3, 0.0) == pytest.approx(0.1 / 2.7)


def test_understeer_needs_more_angle_when_fast(params: CarParams) -> None:
    """If the rear axle is stiffer, the same curve needs a larger angle at higher speed."""
    model = VehicleModel(params)
    assert model.slip_factor < 0.0
    assert model.steering_angle(0.002, 30.0) > model.steering_angle(0.002, 10.0)


def test_there_and_back(params: CarParams) -> None:
    model = VehicleModel(params)
    assert model.steering_angle(model.curvature(0.3, 25.0), 25.0) == pytest.approx(0.3)
