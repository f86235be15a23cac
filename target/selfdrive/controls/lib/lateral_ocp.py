"""The lateral optimal control problem: steer along a path between two lanes.

Terms and constants are those of openpilot v0.4.2.
"""

import math

import casadi as ca

from selfdrive.common.ordered import total
from selfdrive.controls.lib.horizon import INTERVALS, LATERAL_STEP
from selfdrive.controls.lib.mpc_solver import Ocp

COST_PATH, COST_LANE, COST_HEADING = 1.0, 1.0, 1.0
MAX_HEADING = math.radians(90.0)
MAX_DELTA = math.radians(25.0)  # at the road wheels
MAX_RATE = 0.1  # rad/s at the road wheels


def _ode(z: ca.SX, rate: ca.SX, p: ca.SX) -> ca.SX:
    """Derivative of (x, y, heading, road-wheel angle)."""
    curvature_factor, v = p[0], p[1]
    return ca.vertcat(v * ca.cos(z[2]), v * ca.sin(z[2]), v * z[3] * curvature_factor, rate)


def _residuals(z: ca.SX, rate: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Distance to the path, nearness of both lanes, heading and steering rate (not at the end).

    The path is the mean of the lane's middle and the model's path, weighted by the lines' probability.
    """
    x, y, heading, _ = ca.vertsplit(z)
    v, left_prob, right_prob, width = p[1], p[14], p[15], p[16]
    cubics = ca.reshape(p[2:14], 4, 3)
    left, right, model = ca.horzsplit(ca.horzcat(x**3, x**2, x, 1) @ cubics)
    headings = ca.horzsplit(ca.atan(ca.horzcat(3 * x**2, 2 * x, 1) @ cubics[:3, :]))

    lane_prob = left_prob + right_prob - left_prob * right_prob
    by_left = lane_prob * left_prob / (left_prob + right_prob + 0.0001)
    by_right = lane_prob * right_prob / (left_prob + right_prob + 0.0001)
    shares = (by_left, by_right, 1 - lane_prob)
    lines = (left - width / 2, right + width / 2, model)
    off_path = total(share * line for share, line in zip(shares, lines, strict=True)) - y
    off_heading = total(share * angle for share, angle in zip(shares, headings, strict=True)) - heading

    distances = ca.vertcat(off_path, left_prob * ca.exp(y - left), right_prob * ca.exp(right - y))
    stage = ca.vertcat(distances, (v + 1) * off_heading, (v + 1) * rate)
    return stage, ca.vertcat(distances, (2 * v + 1) * off_heading)


def lateral_ocp(steer_rate_cost: float) -> Ocp:
    """Return the problem. Its parameters are curvature factor, speed, the coefficients of left lane, right
    lane and model's path, the probabilities of both lanes, and the lane's width."""
    return Ocp(
        name="lateral_mpc",
        n_state=4,
        n_param=17,
        rk4_step=LATERAL_STEP,
        intervals=INTERVALS,
        ode=_ode,
        residuals=_residuals,
        weights=(COST_PATH, COST_LANE, COST_LANE, COST_HEADING, steer_rate_cost),
        terminal_weights=(COST_PATH, COST_LANE, COST_LANE, COST_HEADING),
        state_bounds=((2, -MAX_HEADING, MAX_HEADING), (3, -MAX_DELTA, MAX_DELTA)),
        control_bound=MAX_RATE,
        shift=True,
    )
