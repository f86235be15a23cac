"""Steady-state bicycle model."""

import pytest
from selfdrive.common.car import CarParams
from selfdrive.controls.lib.vehicle_model import VehicleModel


def test_at_standstill_curvature_follows_from_geometry(params: CarParams) -> None:
    assert VehicleModel(params).curvature(1.3, 0.0) == pytest.approx(0.1 / 2.7)


def test_an_understeering_car_needs_more_angle_at_higher_speed(params: CarParams) -> None:
    model = VehicleModel(params)
    assert model.slip_factor < 0.0
    assert model.steering_angle(0.002, 30.0) > model.steering_angle(0.002, 10.0)


def test_steering_angle_and_curvature_are_inverse(params: CarParams) -> None:
    model = VehicleModel(params)
    assert model.steering_angle(model.curvature(0.3, 25.0), 25.0) == pytest.approx(0.3)
