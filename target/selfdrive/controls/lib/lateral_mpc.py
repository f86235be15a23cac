"""Lateral model-predictive control: how to steer along a path between two lanes.

The optimal control problem, the rules around it and their constants are those of openpilot v0.4.2.
"""

import math
from array import array
from dataclasses import dataclass

import casadi as ca

from selfdrive.car.params import CarParams
from selfdrive.common.ordered import total
from selfdrive.controls.lib.mpc_solver import Iteration, Ocp, build_solver

Poly = tuple[float, float, float, float]

N_NODES = 21
RK4_STEP = 0.05  # s
INTERVALS = ((1, 1.0),) * 5 + ((3, 3.0),) * 15  # 0.05 s, then 0.15 s, which weigh three times as much

COST_PATH, COST_LANE, COST_HEADING = 1.0, 1.0, 1.0
MAX_HEADING = math.radians(90.0)
MAX_DELTA = math.radians(25.0)  # at the road wheels
MAX_RATE = 0.1  # rad/s at the road wheels
MIN_SPEED = 5.0  # m/s, the plan is not made for less: it would be rough
FIRST_RATE = 0.1  # rad/s, the guess to start from when there is no plan yet


@dataclass(slots=True)
class Lanes:
    """The road ahead: cubics y(x) in m, highest power first, left positive, and their probabilities."""

    left_poly: Poly
    right_poly: Poly
    path_poly: Poly  # the model's path
    left_prob: float
    right_prob: float
    lane_width: float  # m


def _ode(z: ca.SX, rate: ca.SX, p: ca.SX) -> ca.SX:
    """Derivative of (x, y, heading, road-wheel angle)."""
    curvature_factor, v = p[0], p[1]
    return ca.vertcat(v * ca.cos(z[2]), v * ca.sin(z[2]), v * z[3] * curvature_factor, rate)


def _residuals(z: ca.SX, rate: ca.SX, p: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Distance to the path, nearness of both lanes, heading and steering rate; without rate at the end.

    The path is the middle of the lane as far as lines are seen, else the model's path.
    """
    x, y, heading, _ = ca.vertsplit(z)
    v, left_prob, right_prob, width = p[1], p[14], p[15], p[16]
    cubics = ca.reshape(p[2:14], 4, 3)
    left, right, model = ca.horzsplit(ca.horzcat(x**3, x**2, x, 1) @ cubics)
    headings = ca.horzsplit(ca.atan(ca.horzcat(3 * x**2, 2 * x, 1) @ cubics[:3, :]))

    seen = left_prob + right_prob - left_prob * right_prob
    by_left = seen * left_prob / (left_prob + right_prob + 0.0001)
    by_right = seen * right_prob / (left_prob + right_prob + 0.0001)
    shares = (by_left, by_right, 1 - seen)
    lines = (left - width / 2, right + width / 2, model)
    off_path = total(share * line for share, line in zip(shares, lines, strict=True)) - y
    off_heading = total(share * angle for share, angle in zip(shares, headings, strict=True)) - heading

    distances = ca.vertcat(off_path, left_prob * ca.exp(y - left), right_prob * ca.exp(right - y))
    stage = ca.vertcat(distances, (v + 1) * off_heading, (v + 1) * rate)
    return stage, ca.vertcat(distances, (2 * v + 1) * off_heading)


def lateral_ocp(steer_rate_cost: float) -> Ocp:
    """The optimal control problem of steering along the path.

    Its parameters are curvature factor, speed, the coefficients of left lane, right lane and model's
    path, the probabilities of both lanes, and the lane's width.
    """
    return Ocp(
        name="lateral_mpc",
        n_state=4,
        n_param=17,
        rk4_step=RK4_STEP,
        intervals=INTERVALS,
        ode=_ode,
        residuals=_residuals,
        weights=(COST_PATH, COST_LANE, COST_LANE, COST_HEADING, steer_rate_cost),
        terminal_weights=(COST_PATH, COST_LANE, COST_LANE, COST_HEADING),
        state_bounds=((2, -MAX_HEADING, MAX_HEADING), (3, -MAX_DELTA, MAX_DELTA)),
        control_bound=MAX_RATE,
        shift=True,
    )


class LateralMpc:
    """Plans the road-wheel angle; one real-time iteration an update (20 Hz, with each model message).

    Results: `angle_desired` (rad at the steering wheel, offset included), `delta_desired` (rad at the
    road wheels, 0.05 s ahead), `delta_plan` (21 nodes, 0..2.5 s: every 0.05 s to 0.25 s, then every
    0.15 s; that of the last finite solution), `nans` (the last solution was not finite), `resets`, the
    number of such solutions.

    A solution that is not finite (lanes hundreds of metres away, NaN in the input) gives NaN for both
    angles until the next update, which starts from nothing and the angle measured. Where the problem
    has no solution (a heading or wheel angle out of bounds by more than the steering rate can mend) or
    is too badly conditioned to find one (lanes more than about 20 m from the plan), the steering rates
    planned before are kept; `unsolved` counts this.
    """

    def __init__(self, params: CarParams) -> None:
        """Uses the car's steering ratio, actuation delay and steering rate cost."""
        self.params = params
        self._iteration = Iteration(build_solver(lateral_ocp(params.steer_rate_cost)))
        self.reset()

    def reset(self) -> None:
        """Back to the state after construction, without building the solver again."""
        self._iteration.restart(control=FIRST_RATE)
        self._delta = 0.0  # rad, where the next plan starts
        self.angle_desired = 0.0
        self.delta_desired = 0.0
        self.delta_plan = array("d", [0.0]) * N_NODES
        self.nans = False
        self.resets = self._iteration.unsolved = 0

    @property
    def unsolved(self) -> int:
        """Number of updates in which the solver failed and the plan's steering rates were kept."""
        return self._iteration.unsolved

    def update(
        self,
        lanes: Lanes,
        v_ego: float,
        steering_angle: float,
        angle_offset: float,
        curvature_factor: float,
    ) -> float:
        """Plan for `lanes`; returns `angle_desired` (rad at the steering wheel).

        Speed in m/s; measured steering-wheel angle and its learnt offset in rad; `curvature_factor`
        in 1/m, the curvature of the car's path for a road-wheel angle of 1 rad. Call it with
        every model message, engaged or not, as the original does: the plan starts from its own last
        angle. A solution that is not finite gives NaN; the next one starts anew at the measured angle.
        """
        ratio = self.params.steer_ratio
        driven = v_ego * self.params.steer_actuator_delay  # m, until a command acts
        start = (driven, 0.0, driven * curvature_factor * steering_angle / ratio, self._delta)
        road = (*lanes.left_poly, *lanes.right_poly, *lanes.path_poly)
        probs = (lanes.left_prob, lanes.right_prob, lanes.lane_width)
        param = (curvature_factor, max(v_ego, MIN_SPEED), *road, *probs)
        self.nans = not self._iteration.run(start, param)
        if self.nans:
            self.resets += 1
            self._iteration.restart(control=FIRST_RATE)
            self._delta = steering_angle / ratio
            self.delta_desired = math.nan
        else:
            self.delta_plan = self._iteration.solution[3 : 4 * N_NODES : 4]
            self._delta = self.delta_desired = self.delta_plan[1]
        self.angle_desired = self.delta_desired * ratio + angle_offset
        return self.angle_desired
