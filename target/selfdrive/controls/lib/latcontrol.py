"""Lateral control: from lanes to steering torque."""

from selfdrive.common.car import CarParams
from selfdrive.common.conversions import DEG_TO_RAD
from selfdrive.controls.lib.lateral_mpc import Lanes, LateralMpc
from selfdrive.controls.lib.pid import PIController
from selfdrive.controls.lib.vehicle_model import VehicleModel
from selfdrive.messages import CarState

MIN_STEER_SPEED = 0.3  # m/s
MIN_SATURATION_SPEED = 10.0  # m/s
MIN_SATURATION_ERROR = 0.1 * DEG_TO_RAD  # rad


class LatControl:
    """Desired steering-wheel angle from the MPC at 20 Hz, tracked by a PI loop at 100 Hz.

    As in the original, each angle is kept until the next. If the MPC has no solution and returns NaN, the
    torque is at its upper limit, full left.
    """

    def __init__(self, params: CarParams) -> None:
        self._params = params
        self.model = VehicleModel(params)
        self.mpc = LateralMpc(params)
        self._pid = PIController(params.steer_kp, params.steer_ki, min_error=MIN_SATURATION_ERROR)
        self._pid.pos_limit = params.steer_max
        self._pid.neg_limit = -params.steer_max
        self.angle_desired = 0.0  # rad at the steering wheel

    @property
    def saturated(self) -> bool:
        return self._pid.saturated

    def plan(self, car: CarState, lanes: Lanes, angle_offset: float) -> None:
        """Solve for the desired angle after a model message; `angle_offset` in rad at the steering wheel."""
        factor = self.model.curvature_factor(car.v_ego)
        self.angle_desired = self.mpc.update(lanes, car.v_ego, car.steering_angle, angle_offset, factor)

    def update(self, car: CarState, active: bool) -> float:
        """Run one cycle; return the torque in -1..1, left positive."""
        if car.v_ego < MIN_STEER_SPEED or not active:
            self._pid.reset()
            return 0.0
        return self._pid.update(
            self.angle_desired,
            car.steering_angle,
            speed=car.v_ego,
            feedforward=self._params.steer_kf * self.angle_desired * car.v_ego**2,
            override=car.steering_pressed,
            check_saturation=car.v_ego > MIN_SATURATION_SPEED,
        )
