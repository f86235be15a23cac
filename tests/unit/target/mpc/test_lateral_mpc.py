"""The lateral MPC: its plan, its limits and unsolvable problems."""

import math
import random
from itertools import pairwise

import pytest
from selfdrive.car.honda.interface import get_params
from selfdrive.controls.lib.lateral_mpc import Lanes, LateralMpc

RATIO = get_params().steer_ratio
V = 20.0  # m/s
CURVATURE_FACTOR = 0.24  # 1/m


def drive(mpc, lanes, times=1, v=V, angle=0.0, offset=0.0):
    for _ in range(times):
        mpc.update(lanes, v, angle, offset, CURVATURE_FACTOR)


def settle(mpc, lanes, times=60):
    """Update until the plan no longer changes, starting from a straight wheel each time."""
    for _ in range(times):
        mpc._delta = 0.0
        drive(mpc, lanes)


def results(mpc):
    scalars = (mpc.angle_desired, mpc.delta_desired, mpc.nans)
    return [repr(value) for value in scalars] + [mpc.delta_plan.tobytes()]


def test_no_steering_is_needed_in_the_middle_of_a_straight_lane(lateral_mpc, lanes):
    settle(lateral_mpc, lanes())
    assert lateral_mpc.angle_desired == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_the_plan_steers_towards_the_path(lateral_mpc, lanes, side):
    settle(lateral_mpc, lanes(0.5))
    left = list(lateral_mpc.delta_plan)
    assert left[1] > 1e-4
    lateral_mpc.reset()
    settle(lateral_mpc, lanes(side * 0.5))
    assert list(lateral_mpc.delta_plan) == pytest.approx([side * x for x in left], abs=1e-6)


def test_in_a_curve_the_plan_holds_the_wheel_angle(lateral_mpc):
    curve = (0.0, 1 / 1000, 0.0)
    road = Lanes((*curve, 1.85), (*curve, -1.85), (*curve, 0.0), 1.0, 1.0, 3.7)
    for _ in range(100):
        drive(lateral_mpc, road, angle=lateral_mpc.angle_desired)
    assert lateral_mpc.delta_desired * CURVATURE_FACTOR == pytest.approx(1 / 500, rel=0.1)


def test_without_lines_the_models_path_is_followed(lateral_mpc, lanes):
    nowhere = lanes(0.5, left_prob=0.0, right_prob=0.0)
    nowhere.left_poly, nowhere.right_poly = (0.0, 0.0, 0.3, 9.0), (0.0, 0.0, -0.3, 9.0)
    settle(lateral_mpc, nowhere)
    with_odd_lines = results(lateral_mpc)
    lateral_mpc.reset()
    settle(lateral_mpc, lanes(0.5, left_prob=0.0, right_prob=0.0))
    assert results(lateral_mpc) == with_odd_lines
    assert lateral_mpc.delta_desired > 1e-4


def test_one_line_and_the_width_give_the_lane(lateral_mpc, lanes):
    one = lanes(0.4, right_prob=0.0)
    one.path_poly = (0.0, 0.0, 0.0, -5.0)
    settle(lateral_mpc, one)
    assert lateral_mpc.delta_desired > 1e-4


def test_the_plan_keeps_the_rate_and_angle_limits(lateral_mpc, lanes):
    for _ in range(120):
        lateral_mpc.update(lanes(8.0), V, 0.0, 0.0, 0.02)
        plan = lateral_mpc.delta_plan
        steps = [0.05] * 5 + [0.15] * 15
        rates = [(b - a) / dt for a, b, dt in zip(plan, plan[1:], steps, strict=False)]
        assert max(map(abs, rates)) < 0.1 + 1e-4
        assert max(map(abs, plan)) < math.radians(25.0) + 1e-4
    assert lateral_mpc.unsolved == 0
    assert max(plan) == pytest.approx(math.radians(25.0), abs=1e-4)


def test_the_plan_starts_after_the_actuation_delay(lateral_mpc, lanes):
    drive(lateral_mpc, lanes(), angle=0.26)
    delay = get_params().steer_actuator_delay
    x, y, heading, delta = lateral_mpc._iteration.solution[:4]
    assert (x, y, delta) == (V * delay, 0.0, 0.0)
    assert heading == pytest.approx(V * CURVATURE_FACTOR * 0.26 / RATIO * delay)


def test_the_plan_continues_from_its_own_angle(lateral_mpc, lanes):
    drive(lateral_mpc, lanes(1.0), offset=0.01)
    wanted = lateral_mpc.delta_desired
    assert lateral_mpc.angle_desired == pytest.approx(wanted * RATIO + 0.01)
    drive(lateral_mpc, lanes(1.0), offset=0.01)
    assert lateral_mpc.delta_plan[0] == pytest.approx(wanted, abs=1e-15)


def test_speeds_below_5_mps_are_planned_as_5_mps(lateral_mpc, lanes):
    drive(lateral_mpc, lanes(0.3), v=0.0)
    assert lateral_mpc._iteration.solution[4] == pytest.approx(5.0 * 0.05, abs=1e-3)


@pytest.mark.parametrize("where", ["lane", "speed", "angle", "lanes too far"])
def test_nan_resets_the_controller(lateral_mpc, lanes, where):
    drive(lateral_mpc, lanes(0.5), times=3)
    broken = lanes(400.0) if where == "lanes too far" else lanes()
    if where == "lane":
        broken.left_poly = (0.0, 0.0, math.nan, 1.0)
    speed = math.nan if where == "speed" else V
    drive(lateral_mpc, broken, v=speed, angle=math.nan if where == "angle" else 0.13)
    assert lateral_mpc.nans
    assert math.isnan(lateral_mpc.angle_desired)
    assert lateral_mpc.resets == 1
    if where != "angle":
        drive(lateral_mpc, lanes(), angle=0.2)
        assert not lateral_mpc.nans
        assert lateral_mpc.delta_plan[0] == 0.13 / RATIO


def test_a_discarded_plan_has_no_later_effect(lateral_mpc, lanes):
    outcomes = []
    for past in (lanes(1.0), lanes(-3.0)):
        lateral_mpc.reset()
        drive(lateral_mpc, past, times=4)
        drive(lateral_mpc, lanes(400.0), angle=0.05)
        drive(lateral_mpc, lanes(0.2), times=5)
        outcomes.append(results(lateral_mpc))
    assert outcomes[0] == outcomes[1]


def test_an_infeasible_problem_steers_back_as_fast_as_allowed(lateral_mpc, lanes):
    """A heading of more than 90 degrees to the left has no solution."""
    drive(lateral_mpc, lanes(2.0), times=3)
    delta = lateral_mpc.delta_desired
    drive(lateral_mpc, lanes(2.0), angle=60.0)
    assert lateral_mpc.unsolved == 1
    assert not lateral_mpc.nans
    assert lateral_mpc.delta_desired == pytest.approx(delta - 0.05 * 0.1, abs=1e-12)


@pytest.mark.parametrize("side", [1, -1])
def test_a_line_far_on_the_other_side_is_followed_as_fast_as_allowed(lateral_mpc, lanes, side):
    """A line 30 m or more on the wrong side makes the problem ill-conditioned.

    The original turns the wheels at its limit of 0.1 rad/s there, so the angle does not waver.
    """
    drive(lateral_mpc, lanes(), times=3)
    angles = [lateral_mpc.delta_desired]
    for k in range(1, 21):
        line, other = (0.0, 0.0, 0.0, -side * (1.85 - 12.0 * k)), (0.0, 0.0, 0.0, side * 1.85)
        lines, probs = ((line, other), (1.0, 0.0)) if side < 0 else ((other, line), (0.0, 1.0))
        drive(lateral_mpc, Lanes(*lines, (0.0, 0.0, 0.0, 0.0), *probs, 3.7))
        angles.append(lateral_mpc.delta_desired)
    assert lateral_mpc.unsolved > 10
    assert [b - a for a, b in pairwise(angles)] == pytest.approx([side * 0.005] * 20, abs=1e-6)


def test_a_reset_instance_behaves_like_a_new_one(lateral_mpc, lanes):
    fresh = LateralMpc(get_params())
    drive(lateral_mpc, lanes(-3.0), times=5, angle=60.0)
    drive(lateral_mpc, lanes(math.nan))
    lateral_mpc.reset()
    assert results(lateral_mpc) == results(fresh)
    for k in range(20):
        for mpc in (lateral_mpc, fresh):
            drive(mpc, lanes(0.3 - 0.01 * k, 0.002 * k), angle=0.01 * k)
        assert results(lateral_mpc) == results(fresh)


def test_any_input_gives_a_result(lateral_mpc, lanes):
    rng = random.Random(2)
    for _ in range(300):
        road = lanes(rng.gauss(0, 30), rng.gauss(0, 1), rng.random(), rng.random())
        road.left_poly = tuple(rng.gauss(0, s) for s in (1e-3, 1e-2, 0.3, 30))
        lateral_mpc.update(road, rng.uniform(0, 90), rng.gauss(0, 5), rng.gauss(0, 0.1), rng.uniform(0, 0.4))
        assert lateral_mpc.nans == math.isnan(lateral_mpc.angle_desired)
