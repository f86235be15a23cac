"""Steers by torque, from lateral accelerations."""

import math

from cereal import Content

from openpilot.common.pid import PIDController

SATURATED = 0.999


class LatControlTorque:
    def __init__(self, params, interface, dt):
        self.factor = params.lateralTuning.torque.latAccelFactor
        self.pid = PIDController(0.5)

    def update(
        self,
        active,
        state,
        vehicle,
        live,
        limited,
        desired_curvature,
        curvature_limited,
        lat_delay,
    ):
        measured_curvature = -vehicle.calc_curvature(math.radians(state.steeringAngleDeg), state.vEgo, 0.0)
        measurement = measured_curvature * state.vEgo**2
        future_desired_lateral_accel = desired_curvature * state.vEgo**2
        error = future_desired_lateral_accel - measurement
        if not active:
            output_torque = 0.0
        else:
            output_torque = (future_desired_lateral_accel + self.pid.update(error)) / self.factor
        saturated = abs(output_torque) > SATURATED
        return -output_torque, 0.0, Content(actualLateralAccel=measurement, saturated=saturated)
