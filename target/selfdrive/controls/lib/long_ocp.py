"""The longitudinal optimal control problem: follow one lead vehicle.

Terms and constants are those of openpilot v0.4.2.
"""

import math

import casadi as ca

from selfdrive.controls.lib.horizon import INTERVALS, LONGITUDINAL_STEP
from selfdrive.controls.lib.mpc_solver import Ocp

COST_TTC, COST_DISTANCE, COST_ACCELERATION, COST_JERK = 5.0, 0.1, 10.0, 20.0
TIME_GAP = 1.8  # s
STANDSTILL_GAP = 4.0  # m
BRAKING = 2 * 9.81  # m/s^2, twice the assumed deceleration of both cars


def _ode(z: ca.SX, jerk: ca.SX, decay: ca.SX) -> ca.SX:
    """Derivative of (x, v, a of the host; x, v, a of the lead); the lead's acceleration decays."""
    return ca.vertcat(z[1], z[2], jerk, z[4], z[5], -decay * z[5])


def _residuals(z: ca.SX, jerk: ca.SX, decay: ca.SX) -> tuple[ca.SX, ca.SX]:
    """Danger of a collision, error of the gap, acceleration and jerk (not at the end)."""
    x, v, a, x_lead, v_lead, _ = ca.vertsplit(z)
    desired_gap = STANDSTILL_GAP + TIME_GAP * (2 * v - v_lead) + (v * v - v_lead * v_lead) / BRAKING
    lack = desired_gap - (x_lead - x)
    danger = ca.exp(0.3 * lack / (ca.sqrt(v + 0.5) + 0.1)) - 1
    comfort = 1 + v / 10
    end = ca.vertcat(danger, -lack / (0.1 * v + 0.5), a * comfort)
    return ca.vertcat(end, jerk * comfort), end


def long_ocp() -> Ocp:
    """Return the problem; its parameter is the decay of the lead's acceleration in 1/s."""
    return Ocp(
        name="long_mpc",
        n_state=6,
        n_param=1,
        rk4_step=LONGITUDINAL_STEP,
        intervals=INTERVALS,
        ode=_ode,
        residuals=_residuals,
        weights=(COST_TTC, COST_DISTANCE, COST_ACCELERATION, COST_JERK),
        terminal_weights=(COST_TTC, COST_DISTANCE, COST_ACCELERATION),
        state_bounds=((1, 0.0, math.inf),),
        linear=True,
    )
