"""Acceleration limits for cruising at the set speed."""

from math import sqrt

from selfdrive.common.interp import interp
from selfdrive.controls.lib.speed_smoother import Limits
from selfdrive.messages import LeadData

BREAKPOINTS = (0.0, 5.0, 10.0, 20.0, 40.0)  # m/s
A_MIN = (-1.0, -0.8, -0.67, -0.5, -0.3)  # m/s^2
A_MAX = (1.0, 1.0, 0.8, 0.5, 0.3)
A_MAX_FOLLOWING = (1.5, 1.5, 1.2, 0.7, 0.3)
MIN_JERK = 0.1  # m/s^3

A_TOTAL = ((0.0, 20.0, 40.0), (1.5, 1.9, 3.2))  # m/s^2 over m/s, longitudinal and lateral combined
FOLLOWING_DISTANCE = 45.0  # m
ABSENT_DRIVER_A = -0.2  # m/s^2


def is_following(v_ego: float, lead: LeadData) -> bool:
    near = lead.status and lead.d_rel < FOLLOWING_DISTANCE
    return near and lead.v_lead_k > v_ego and lead.a_lead_k > 0.0


def cruise_limits(v_ego: float, following: bool, a_lateral: float, slow_down: bool) -> Limits:
    """Return the limits at `v_ego` (m/s) with a lateral acceleration of `a_lateral` (m/s^2).

    Turns leave less acceleration; `slow_down` forces a gentle deceleration. The jerk limits have the same
    numbers as the acceleration limits on a straight road.
    """
    a_min = interp(v_ego, BREAKPOINTS, A_MIN)
    a_max = interp(v_ego, BREAKPOINTS, A_MAX_FOLLOWING if following else A_MAX)
    j_min, j_max = min(-MIN_JERK, a_min), max(MIN_JERK, a_max)
    a_total = interp(v_ego, *A_TOTAL)
    a_max = min(a_max, sqrt(max(a_total * a_total - a_lateral * a_lateral, 0.0)))
    if slow_down:
        a_max = min(a_max, ABSENT_DRIVER_A)
        a_min = min(a_min, a_max)
    return Limits(a_min, a_max, j_min, j_max)
