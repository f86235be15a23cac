"""Lateral model-predictive control: steers along a path between two lanes.

Problem, rules and constants are those of openpilot v0.4.2.
"""

import math
from array import array
from dataclasses import dataclass

from selfdrive.common.car import CarParams
from selfdrive.controls.lib.compiled_mpc import build_lateral
from selfdrive.controls.lib.horizon import N_NODES
from selfdrive.controls.lib.mpc_iteration import Iteration

Poly = tuple[float, float, float, float]

MIN_SPEED = 5.0  # m/s; the plan uses at least this speed, to avoid rough solutions
FIRST_RATE = 0.1  # rad/s, the initial guess without a plan


@dataclass(slots=True)
class Lanes:
    """The road ahead: cubics y(x) in m (highest power first, left positive) and their probabilities."""

    left_poly: Poly
    right_poly: Poly
    path_poly: Poly  # the model's path
    left_prob: float
    right_prob: float
    lane_width: float  # m


class LateralMpc:
    """Plans the road-wheel angle, with one real-time iteration per model message (20 Hz).

    Results: `angle_desired` (rad at the steering wheel, offset included), `delta_desired` (rad at the road
    wheels, 0.05 s ahead), `delta_plan` (the last finite solution at 21 nodes, 0..2.5 s: every 0.05 s to 0.25
    s, then every 0.15 s), `nans` (whether the last solution was not finite), `resets` (the number of such
    solutions).

    A non-finite solution (lanes hundreds of metres away, NaN in the input) gives NaN for both angles; the
    next update restarts from the measured angle. If the problem has no solution (a heading or wheel angle too
    far out of bounds for the steering rate) or is badly conditioned (lanes more than about 20 m from the
    plan), it is solved without the bounds of heading and wheel angle, and `unsolved` is incremented.
    """

    def __init__(self, params: CarParams) -> None:
        self.params = params
        self._iteration = Iteration(build_lateral(params.steer_rate_cost))
        self.reset()

    def reset(self) -> None:
        """Return to the initial state without rebuilding the solver."""
        self._iteration.restart(control=FIRST_RATE)
        self._delta = 0.0  # rad, where the next plan starts
        self.angle_desired = 0.0
        self.delta_desired = 0.0
        self.delta_plan = array("d", [0.0]) * N_NODES
        self.nans = False
        self.resets = self._iteration.unsolved = 0

    @property
    def unsolved(self) -> int:
        return self._iteration.unsolved

    def update(
        self,
        lanes: Lanes,
        v_ego: float,
        steering_angle: float,
        angle_offset: float,
        curvature_factor: float,
    ) -> float:
        """Plan for `lanes`; return `angle_desired` (rad at the steering wheel).

        Speed in m/s; measured steering-wheel angle and its learnt offset in rad; `curvature_factor` in 1/m is
        the path curvature for a road-wheel angle of 1 rad. Call this with every model message, engaged or
        not, as the original does: each plan starts from the previous plan's angle.
        """
        ratio = self.params.steer_ratio
        driven = v_ego * self.params.steer_actuator_delay  # m until a command takes effect
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
