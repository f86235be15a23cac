"""What the controller needs of a car: its data and tuning, and a way to read and command it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from selfdrive.messages import CanFrame, CarControl, CarState


@dataclass(frozen=True, slots=True, kw_only=True)
class CarParams:
    """Physical data and tuning of one car model. Tables are (breakpoints, values).

    Speeds in m/s, masses in kg, lengths in m, stiffness in N/rad, inertia in kg m^2. Gains of the lateral PI
    loop are per radian of steering-wheel angle, `steer_kf` also per (m/s)^2, because the self-aligning torque
    grows with lateral acceleration.
    """

    name: str
    mass: float
    wheelbase: float
    center_to_front: float
    steer_ratio: float
    rotational_inertia: float
    tire_stiffness_front: float
    tire_stiffness_rear: float
    steer_kp: tuple[tuple[float, ...], tuple[float, ...]]
    steer_ki: tuple[tuple[float, ...], tuple[float, ...]]
    steer_kf: float
    steer_max: float
    steer_actuator_delay: float  # s
    steer_rate_cost: float
    long_kp: tuple[tuple[float, ...], tuple[float, ...]]
    long_ki: tuple[tuple[float, ...], tuple[float, ...]]
    gas_max: tuple[tuple[float, ...], tuple[float, ...]]
    brake_max: tuple[tuple[float, ...], tuple[float, ...]]
    acceleration_per_output: float  # m/s^2 for an output of 1; divides the feedforward
    radar_offset: float  # m from the camera to the radar, which is at the front bumper
    steer_limit_alert: bool
    start_acceleration: float = 0.5  # m/s^2, target while the brake is released to start moving


class Car(Protocol):
    def update(self, frames: Sequence[CanFrame], t: float) -> CarState:
        """Return the car's state at time `t` (s), from the frames received since the last call."""
        ...

    def apply(self, control: CarControl, frame: int) -> list[CanFrame]:
        """Return the frames that command the car in this cycle, the `frame`-th."""
        ...
