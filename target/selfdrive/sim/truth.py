"""The true state of the simulated world, independent of sensors."""

from typing import NamedTuple


class GroundTruth(NamedTuple):
    """The world after the step that began at `t`. SI units, radians, left positive."""

    t: float  # s
    d_rel: float  # m, bumper to bumper; 200 on a free road
    v_ego: float  # m/s
    v_lead: float  # m/s; the car's speed on a free road
    a_ego: float  # m/s^2
    lateral_offset: float  # m from the middle of the lane
    heading: float  # rad relative to the road
    steer_angle: float  # rad at the steering wheel
    steer_rate: float  # rad/s
    position: float  # m along the road
    hwt: float  # s, headway time
    free_road: bool  # no lead vehicle
