"""Reaches a target speed within acceleration and jerk limits."""

from math import sqrt
from typing import NamedTuple

WRONG_WAY_FACTOR = 3.0  # allowed jerk factor while accelerating away from the target


class Limits(NamedTuple):
    """Bounds of acceleration (m/s^2) and jerk (m/s^3); the lower ones are negative."""

    a_min: float
    a_max: float
    j_min: float
    j_max: float


def smooth_speed(v: float, a: float, v_target: float, limits: Limits, dt: float) -> tuple[float, float]:
    """Return speed and acceleration `dt` s from now, on the fastest way from (v, a) to (v_target, 0)."""
    a_min, a_max, j_min, j_max = limits
    dv = v_target - v
    if dv > 0.0 and a < 0.0:
        j_max *= WRONG_WAY_FACTOR
    elif dv < 0.0 and a > 0.0:
        j_min *= WRONG_WAY_FACTOR

    if a > a_max or a < a_min:  # first return to the limits
        bound, jerk = (a_max, j_min) if a > a_max else (a_min, j_max)
        t_back = (bound - a) / jerk
        if dt <= t_back:
            return v + dt * a + 0.5 * dt * dt * jerk, a + dt * jerk
        gained = 0.5 * (bound * bound - a * a) / jerk
        v, dv, a, dt = v + gained, dv - gained, bound, dt - t_back

    # speed still gained if acceleration returns to zero immediately
    dv_settle = -0.5 * a * a / (j_min if a >= 0.0 else j_max)
    if dv < dv_settle:  # to slow down, speed up with all signs reversed
        gained, a = _raise(-dv, -a, -a_min, -j_max, -j_min, dt)
        return v - gained, -a
    gained, a = _raise(dv, a, a_max, j_min, j_max, dt)
    return v + gained, a


def _raise(dv: float, a: float, a_max: float, j_min: float, j_max: float, dt: float) -> tuple[float, float]:
    """Speed gained and acceleration after `dt` of jerk up, hold, jerk down, to gain `dv` in total."""
    # the small term keeps the root's argument non-negative
    a_peak = sqrt((0.5 * a * a / j_max + dv + 1e-9) / (0.5 / j_max - 0.5 / j_min))
    if a_peak > a_max:
        a_peak = a_max
        t1 = (a_peak - a) / j_max
        if a_peak <= 0.0:  # the target is out of reach: hold the limit
            t2 = t1 + dt + 1e-9
            t3 = t2
        else:
            dv_hold = dv - 0.5 * (a_peak * a_peak - a * a) / j_max + 0.5 * a_peak * a_peak / j_min
            t2 = t1 + (dv_hold / a_peak if dv_hold < a_peak * dt else dt)
            t3 = t2 - a_peak / j_min
    else:
        t1 = t2 = (a_peak - a) / j_max
        t3 = t2 - a_peak / j_min
    if dt > t3:
        return dv, 0.0
    up = min(dt, t1)
    hold = max(min(dt, t2) - t1, 0.0)
    down = max(min(dt, t3) - t2, 0.0)
    gained = a * up + 0.5 * up * up * j_max + a_peak * (hold + down) + 0.5 * down * down * j_min
    return gained, a + j_max * up + j_min * down
