"""Steady-state bicycle model: converts between steering angle and curvature.

Source: M. Guiggiani, The Science of Vehicle Dynamics (2014), steady-state cornering.
"""

from selfdrive.common.car import CarParams


class VehicleModel:
    """Curvature in 1/m, angles in rad at the steering wheel, speeds in m/s."""

    def __init__(self, params: CarParams) -> None:
        self.wheelbase = params.wheelbase
        self.steer_ratio = params.steer_ratio
        rear = params.wheelbase - params.center_to_front
        stiff_front, stiff_rear = params.tire_stiffness_front, params.tire_stiffness_rear
        balance = stiff_front * params.center_to_front - stiff_rear * rear
        # s^2/m^2; negative for understeer: curvature falls with speed
        self.slip_factor = params.mass * balance / (params.wheelbase**2 * stiff_front * stiff_rear)

    def curvature_factor(self, v_ego: float) -> float:
        """Return the curvature for one radian at the road wheels (1/m)."""
        return 1.0 / ((1.0 - self.slip_factor * v_ego * v_ego) * self.wheelbase)

    def curvature(self, steering_angle: float, v_ego: float) -> float:
        return self.curvature_factor(v_ego) * steering_angle / self.steer_ratio

    def steering_angle(self, curvature: float, v_ego: float) -> float:
        return curvature * self.steer_ratio / self.curvature_factor(v_ego)
