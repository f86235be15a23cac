"""Both MPCs minimise the intended costs, which these tests state as plain formulas."""

import math
from itertools import pairwise

import numpy as np
import pytest
from selfdrive.controls.lib.lateral_mpc import Lanes
from selfdrive.controls.lib.long_mpc import LEAD_DECAY

FACTORS = np.array([1.0] * 5 + [3.0] * 15 + [1.0])  # the long intervals have weight 3, the end has weight 1


def flattest(cost, controls, scale):
    """Return the largest slope of the cost along a control, relative to that at a slightly different plan.

    The slopes are central differences.
    """
    bases = np.eye(len(controls)) * scale

    def slope(u):
        return np.array([cost(u + e) - cost(u - e) for e in bases]) / (2 * scale)

    return np.abs(slope(controls)).max() / np.abs(slope(controls + 100 * scale)).max()


def long_cost(jerks, v, a, x_lead, v_lead):
    steps = [0.2] * 5 + [0.6] * 15
    x, xs = 0.0, []
    for k in range(21):
        xs.append((x, v, a, x_lead))
        if k < 20:
            h, j = steps[k], jerks[k]
            x, v, a = x + h * v + h * h * a / 2 + h**3 * j / 6, v + h * a + h * h * j / 2, a + h * j
            x_lead += h * v_lead
    x, v, a, x_lead = np.array(xs).T
    gap, wanted = x_lead - x, 4 + 1.8 * v - 1.8 * (v_lead - v) + v**2 / 19.62 - v_lead**2 / 19.62
    danger = np.exp(0.3 * (wanted - gap) / (np.sqrt(v + 0.5) + 0.1)) - 1
    cost = 5 * danger**2 + 0.1 * ((gap - wanted) / (0.1 * v + 0.5)) ** 2 + 10 * (a * (1 + v / 10)) ** 2
    cost[:20] += 20 * (jerks * (1 + v[:20] / 10)) ** 2
    return FACTORS @ cost


@pytest.mark.parametrize(("v", "a", "gap", "v_lead"), [(20.0, -0.3, 45.0, 18.0), (25.0, 0.0, 60.0, 26.0)])
def test_the_longitudinal_plan_minimises_its_cost(long_mpc, lead, v, a, gap, v_lead):
    for _ in range(50):
        long_mpc.set_cur_state(v, a)
        long_mpc.update(v, a, lead(gap, v_lead))
    jerks = np.array(long_mpc._iteration.solution[6 * 21 :])
    assert flattest(lambda u: long_cost(u, v, a, gap, v_lead), jerks, 1e-4) < 1e-3


def test_the_first_guess_brakes_evenly_to_the_leads_speed(long_mpc):
    long_mpc.v_mpc = 20.0
    long_mpc._simulate(80.0, 10.0, 0.0, LEAD_DECAY)
    speeds = long_mpc._iteration.guess[1:126:6]
    steps = [0.2] * 5 + [0.6] * 15
    assert speeds[0] == 20.0
    assert [b - a for a, b in pairwise(speeds)] == pytest.approx([-0.625 * h for h in steps], rel=1e-3)


ROAD = Lanes((0, 4e-4, 0.01, 2.2), (0, 4e-4, 0.01, -1.4), (0, 3e-4, 0.0, 0.1), 0.9, 0.7, 3.6)
FACTOR, SPEED = 0.24, 15.0


def lateral_cost(rates, delta):
    z, nodes = np.array([0.1 * SPEED, 0.0, 0.0, delta]), []
    for k in range(21):
        nodes.append(z)
        for _ in range(0 if k == 20 else 1 if k < 5 else 3):
            z = rk4(z, rates[k])
    x, y, heading, _ = np.array(nodes).T
    left, right, model = (np.polyval(p, x) for p in (ROAD.left_poly, ROAD.right_poly, ROAD.path_poly))
    slopes = [
        np.arctan(np.polyval(np.polyder(p), x)) for p in (ROAD.left_poly, ROAD.right_poly, ROAD.path_poly)
    ]
    p, q = ROAD.left_prob, ROAD.right_prob
    seen, share = p + q - p * q, np.array([p, q]) / (p + q + 0.0001)

    def along(lines):
        return seen * (share[0] * lines[0] + share[1] * lines[1]) + (1 - seen) * lines[2]

    off_path = along((left - 1.8, right + 1.8, model)) - y
    turn = along(slopes) - heading
    cost = off_path**2 + (p * np.exp(y - left)) ** 2 + (q * np.exp(right - y)) ** 2
    cost[:20] += ((SPEED + 1) * turn[:20]) ** 2 + 0.5 * ((SPEED + 1) * rates) ** 2
    cost[20] += ((2 * SPEED + 1) * turn[20]) ** 2
    return FACTORS @ cost


def rk4(z, rate):
    def f(z):
        return np.array(
            [SPEED * math.cos(z[2]), SPEED * math.sin(z[2]), SPEED * z[3] * FACTOR, rate], dtype=float
        )

    k1 = f(z)
    k2 = f(z + 0.025 * k1)
    k3 = f(z + 0.025 * k2)
    k4 = f(z + 0.05 * k3)
    return z + 0.05 / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def test_the_lateral_plan_minimises_its_cost(lateral_mpc):
    for _ in range(60):  # each iteration starts from the last solution, not shifted
        lateral_mpc._delta = 0.002
        lateral_mpc._iteration.guess[:] = lateral_mpc._iteration.solution
        lateral_mpc.update(ROAD, SPEED, 0.0, 0.0, FACTOR)
    rates = np.array(lateral_mpc._iteration.solution[4 * 21 :])
    assert np.abs(rates).max() < 0.1  # no limit is reached, so the slope must vanish
    assert flattest(lambda u: lateral_cost(u, 0.002), rates, 1e-6) < 1e-3
