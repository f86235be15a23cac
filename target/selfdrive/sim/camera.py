"""The camera: what stands ahead of the car, 20 times a second."""

from typing import NamedTuple


class CameraView(NamedTuple):
    """One view. Lateral positions in m in the car's frame, left positive; distances from the bumper."""

    left_lane_y: float  # m, at the car
    right_lane_y: float  # m, at the car
    path_y: float  # m, middle of the lane at the car
    bend: tuple[float, ...]  # m, how far the lines have moved sideways at 0, 1, ... 49 m
    lead_d_rel: float  # m
