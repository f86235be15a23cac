"""Lateral motion: torque turns the steering wheel, tyres turn the car.

Steering: `J w' = T u - c w - trail * F_front / ratio`, with the commanded torque `u` (1 is the EPS's maximum)
and the lateral force of the front tyres `F_front`, which straightens the wheel. Damping (motor friction,
gearing, the EPS's return damping) dominates, as in LKAS actuators: full torque turns the wheel by 0.5 rad/s
from straight ahead, and at speed holds 2.8 m/s^2 of lateral acceleration. In the controller's loop, the wheel
follows a demand in about 0.1 s, the delay that the path planner assumes.

Car: linear bicycle model in lateral speed and yaw rate, advanced by implicit Euler because its poles diverge
as 1/speed; at walking pace it becomes the kinematic model.
"""

from math import cos, sin
from typing import Protocol

from selfdrive.common.car import CarParams
from selfdrive.common.interp import clip
from selfdrive.common.realtime import DT_CTRL

FULL_STEERING_TORQUE = 10.0  # N m at the steering wheel, for a command of 1
COLUMN_INERTIA = 0.1  # kg m^2, wheel, column and motor
COLUMN_DAMPING = 20.0  # N m s/rad
TYRE_TRAIL = 0.053  # m, caster and pneumatic trail
MOST_STEER_ANGLE = 8.7  # rad, mechanical stop
MIN_TYRE_SPEED = 0.1  # m/s; tyres take no side force below this
MIN_SHARE_OF_BEND_RADIUS = 0.1  # of a bend's radius; at its centre, `along` is undefined


class LateralMotion(Protocol):
    """Position in the lane (m, rad) and state of the steering wheel (rad, rad/s)."""

    offset: float
    heading: float
    steer_angle: float
    steer_rate: float

    def step(self, torque: float, speed: float, curvature: float) -> float:
        """Advance 10 ms; return the speed along the road (m/s)."""


class LateralDynamics:
    """Steering and lateral motion; `offset` (m) and `heading` (rad) are relative to the lane centre."""

    def __init__(self, car: CarParams, offset: float = 0.0) -> None:
        self.offset = offset
        self.heading = 0.0
        self.steer_angle = 0.0  # rad at the steering wheel
        self.steer_rate = 0.0  # rad/s
        self.lateral_speed = 0.0  # m/s, of the centre of mass, in the car's frame
        self.yaw_rate = 0.0  # rad/s
        self._car = car
        front, rear = car.center_to_front, car.wheelbase - car.center_to_front
        c_front, c_rear, mass, inertia = (
            car.tire_stiffness_front,
            car.tire_stiffness_rear,
            car.mass,
            car.rotational_inertia,
        )
        self._side_damping = DT_CTRL * (c_front + c_rear) / mass
        self._coupling = DT_CTRL * (rear * c_rear - front * c_front)
        self._yaw_damping = DT_CTRL * (front * front * c_front + rear * rear * c_rear) / inertia
        self._side_gain = DT_CTRL * c_front / mass
        self._yaw_gain = DT_CTRL * front * c_front / inertia

    def step(self, torque: float, speed: float, curvature: float) -> float:
        """Advance 10 ms with `torque` (left positive, 1 is full); return the speed along the road (m/s)."""
        self._turn_wheel(torque, speed)
        self._move(speed)
        offset, v_lat = self.offset, self.lateral_speed
        cosine, sine = cos(self.heading), sin(self.heading)
        along = (speed * cosine - v_lat * sine) / max(1.0 - curvature * offset, MIN_SHARE_OF_BEND_RADIUS)
        self.offset = offset + DT_CTRL * (speed * sine + v_lat * cosine)
        self.heading += DT_CTRL * (self.yaw_rate - curvature * along)
        return along

    def _turn_wheel(self, torque: float, speed: float) -> None:
        ratio = self._car.steer_ratio
        drive = FULL_STEERING_TORQUE * torque - TYRE_TRAIL * self._front_force(speed) / ratio
        momentum = COLUMN_INERTIA * self.steer_rate + DT_CTRL * drive
        self.steer_rate = momentum / (COLUMN_INERTIA + DT_CTRL * COLUMN_DAMPING)
        angle = self.steer_angle + DT_CTRL * self.steer_rate
        self.steer_angle = clip(angle, -MOST_STEER_ANGLE, MOST_STEER_ANGLE)
        if self.steer_angle != angle:
            self.steer_rate = 0.0

    def _front_force(self, speed: float) -> float:
        """Lateral force of the front axle (N), left positive."""
        if speed < MIN_TYRE_SPEED:
            return 0.0
        car = self._car
        slip = self.steer_angle / car.steer_ratio
        slip -= (self.lateral_speed + car.center_to_front * self.yaw_rate) / speed
        return car.tire_stiffness_front * slip

    def _move(self, v: float) -> None:
        """Implicit Euler step of the bicycle model, with both equations multiplied by the speed."""
        car = self._car
        wheel = self.steer_angle / car.steer_ratio
        a11 = v + self._side_damping
        a12 = DT_CTRL * v * v - self._coupling / car.mass
        a21 = -self._coupling / car.rotational_inertia
        a22 = v + self._yaw_damping
        b1 = v * (self.lateral_speed + self._side_gain * wheel)
        b2 = v * (self.yaw_rate + self._yaw_gain * wheel)
        determinant = a11 * a22 - a12 * a21
        self.lateral_speed = (b1 * a22 - a12 * b2) / determinant
        self.yaw_rate = (a11 * b2 - a21 * b1) / determinant
