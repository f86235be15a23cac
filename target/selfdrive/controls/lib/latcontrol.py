"""Lateral control: from the lanes to a steering torque."""

from selfdrive.car.params import CarParams
from selfdrive.common.conversions import DEG_TO_RAD
from selfdrive.common.realtime import DT_CTRL, DT_MDL
from selfdrive.controls.lib.lateral_mpc import Lanes, LateralMpc
from selfdrive.controls.lib.pid import PIController
from selfdrive.controls.lib.vehicle_model import VehicleModel
from selfdrive.messages import CarState

MIN_STEER_SPEED = 0.3  # m/s
MIN_SATURATION_SPEED = 10.0  # m/s
MIN_SATURATION_ERROR = 0.1 * DEG_TO_RAD  # rad


class LatControl:
    """A wanted steering-wheel angle from the MPC at 20 Hz, held by a PI loop at 100 Hz."""

    def __init__(self, params: CarParams) -> None:
        self._params = params
        self.model = VehicleModel(params)
        self.mpc = LateralMpc(params)
        self._pid = PIController(params.steer_kp, params.steer_ki, min_error=MIN_SATURATION_ERROR)
        self._pid.pos_limit = params.steer_max
        self._pid.neg_limit = -params.steer_max
        self.angle_desired = 0.0  # rad at the steering wheel
        self._angle_last = 0.0  # rad, wanted by the MPC one model message ago
        self._angle_next = 0.0  # rad, wanted by the MPC at the end of the current interval
        self._planned_at = 0.0  # s

    @property
    def saturated(self) -> bool:
        """The wanted angle has been out of the steering's reach for some time."""
        return self._pid.saturated

    def reset(self) -> None:
        """Not in control: forget the loop's history."""
        self._pid.reset()

    def plan(self, t: float, car: CarState, lanes: Lanes, angle_offset: float) -> None:
        """A new model message: solve for the angle wanted 50 ms from `t` (s)."""
        factor = self.model.curvature_factor(car.v_ego)
        self._angle_last = self._angle_next
        self._angle_next = self.mpc.update(lanes, car.v_ego, car.steering_angle, angle_offset, factor)
        self._planned_at = t

    def update(self, t: float, car: CarState, active: bool) -> float:
        """One cycle at time `t` (s); returns the torque in -1..1, left positive."""
        if car.v_ego < MIN_STEER_SPEED or not active:
            self._pid.reset()
            return 0.0
        # a late model message must not be extrapolated for long
        age = min(t - self._planned_at, DT_MDL + DT_CTRL) + DT_CTRL
        self.angle_desired = self._angle_last + age / DT_MDL * (self._angle_next - self._angle_last)
        return self._pid.update(
            self.angle_desired,
            car.steering_angle,
            speed=car.v_ego,
            override=car.steering_pressed,
            check_saturation=car.v_ego > MIN_SATURATION_SPEED,
        )
