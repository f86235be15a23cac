"""The messages between the parts of the controller, in SI units and radians.

Left is positive for lateral positions, angles and steering torque. Receivers must not change messages; these
are not frozen because creating a frozen one takes four times as long.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

VIEW_LENGTH = 50  # points of a line ahead, 1 m apart


class CanFrame(NamedTuple):
    """One CAN frame. Bus 0 is the car, bus 1 the radar."""

    address: int
    data: bytes
    bus: int


@dataclass(slots=True)
class ButtonEvent:
    """A cruise button press or release: 'accel', 'decel', 'cancel' or 'setting'."""

    type: str
    pressed: bool


@dataclass(slots=True)
class CarState:
    t: float = 0.0  # s, when the frames were read
    can_valid: bool = False
    v_ego: float = 0.0  # m/s, filtered
    v_ego_raw: float = 0.0  # m/s, as measured
    a_ego: float = 0.0  # m/s^2, from the speed filter
    standstill: bool = False
    gas: float = 0.0  # pedal position, 0..1
    gas_pressed: bool = False
    brake_pressed: bool = False
    steering_angle: float = 0.0  # rad at the steering wheel
    steering_rate: float = 0.0  # rad/s
    steering_torque: float = 0.0  # driver's torque, in the sensor's counts
    steering_pressed: bool = False
    cruise_available: bool = False  # the main switch is on
    cruise_enabled: bool = False
    cruise_speed: float = 0.0  # m/s
    gear: str = "unknown"
    left_blinker: bool = False
    right_blinker: bool = False
    door_open: bool = False
    seatbelt_unlatched: bool = False
    esp_disabled: bool = False
    steer_error: bool = False
    steer_not_allowed: bool = False
    brake_error: bool = False
    brake_hold: bool = False
    park_brake: bool = False
    buttons: tuple[ButtonEvent, ...] = ()
    events: tuple = ()  # of controls.lib.events.Event


@dataclass(slots=True)
class RadarPoint:
    track_id: int
    d_rel: float  # m, from the radar's mounting point
    y_rel: float  # m, left positive
    v_rel: float  # m/s, v_lead - v_ego


@dataclass(slots=True)
class RadarData:
    """One complete radar cycle (20 Hz). `errors` is empty or names 'comm_issue' or 'fault'."""

    t: float
    points: tuple[RadarPoint, ...] = ()
    errors: tuple[str, ...] = ()


class CameraView(NamedTuple):
    """What the camera sees, as geometry in the car's frame (m, left positive).

    `picture` is 8 bit grey, rows x columns; None if the run has no pictures. Lane detectors that read it
    use no other field.
    """

    left_lane_y: float  # at the car
    right_lane_y: float  # at the car
    path_y: float  # middle of the lane, at the car
    bend: tuple[float, ...]  # lateral shift of the lines at 0, 1, ... 49 m ahead
    lead_d_rel: float  # from the front bumper
    picture: np.ndarray | None = None


@dataclass(slots=True)
class PathData:
    """A line ahead of the car: lateral positions (m, left positive) at 0, 1, ... 49 m.

    If the line was not seen, `valid` is False, `prob` is 0, and the points are the expected ones.
    """

    points: tuple[float, ...]
    prob: float
    std: float  # m
    valid: bool = True


@dataclass(slots=True)
class LeadVision:
    """The lead vehicle as the camera sees it; `d_rel` (m from the front bumper) and its `std` (m)."""

    d_rel: float
    prob: float
    std: float


@dataclass(slots=True)
class ModelData:
    """The vision model's output at 20 Hz."""

    t: float
    path: PathData
    left_lane: PathData
    right_lane: PathData
    lead: LeadVision


@dataclass(slots=True)
class LeadData:
    """A lead vehicle from radard; all zero if `status` is False."""

    status: bool = False
    d_rel: float = 0.0  # m
    y_rel: float = 0.0  # m
    v_rel: float = 0.0  # m/s
    a_rel: float = 0.0  # m/s^2
    v_lead: float = 0.0  # m/s
    d_path: float = 0.0  # m, lateral distance to the predicted path
    v_lat: float = 0.0  # m/s
    v_lead_k: float = 0.0  # m/s, filtered
    a_lead_k: float = 0.0  # m/s^2, filtered
    fcw: bool = False  # fused with the camera often enough for a collision warning


@dataclass(slots=True)
class RadarState:
    """radard's output (20 Hz)."""

    t: float
    lead_one: LeadData
    lead_two: LeadData
    errors: tuple[str, ...] = ()


@dataclass(slots=True)
class Actuators:
    """Gas and brake in 0..1, steer torque in -1..1 (left positive).

    The controller sets these three. The others are what a driver or an emergency brake does beside it.
    """

    gas: float = 0.0
    brake: float = 0.0
    steer: float = 0.0
    extra_deceleration: float = 0.0  # m/s^2, 0..9; the brakes follow the stronger demand
    brake_pedal: float = 0.0  # 1 if the driver presses the brake pedal, which the controller can read


@dataclass(slots=True)
class CarControl:
    enabled: bool = False
    actuators: Actuators = field(default_factory=Actuators)
    cancel_cruise: bool = False
    set_speed: float = 0.0  # m/s, shown on the dashboard
    speed_visible: bool = False
    lanes_visible: bool = False
    lead_visible: bool = False
    visual_alert: str = "none"  # none, fcw, steer_required, brake_pressed, wrong_gear, ...
    audible_alert: str = "none"


@dataclass(slots=True)
class Plan:
    t: float = 0.0
    v_target: float = 0.0  # m/s
    a_target: float = 0.0  # m/s^2
    v_target_future: float = 0.0  # m/s at the plan's end; decides stopping and starting
    source: str = "cruise"  # cruise, mpc1 or mpc2
    has_lead: bool = False
    fcw: bool = False
    d_poly: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # path to follow, highest power first
    lane_width: float = 3.7  # m
    events: tuple = ()


@dataclass(slots=True)
class ControlsState:
    t: float = 0.0
    state: str = "disabled"  # disabled, pre_enabled, enabled, soft_disabling
    enabled: bool = False
    active: bool = False
    v_ego: float = 0.0  # m/s
    a_ego: float = 0.0  # m/s^2
    steering_angle: float = 0.0  # rad, as measured
    angle_desired: float = 0.0  # rad at the steering wheel
    v_cruise: float = 0.0  # m/s; 255 km/h before the first engagement
    v_pid: float = 0.0  # m/s
    long_state: str = "off"  # off, pid, stopping, starting
    steer_saturated: bool = False
    steer_override: bool = False  # the driver steers
    alerts: tuple[str, ...] = ()  # names of all alerts active now, highest priority first
    alert_text1: str = ""
    alert_text2: str = ""
    events: tuple[str, ...] = ()  # names of the events of this cycle
