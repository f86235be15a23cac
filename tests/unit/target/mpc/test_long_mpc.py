"""Longitudinal MPC: its plan, and the rules for leads, first guesses and resets."""

import csv
import math
import os
import random
from array import array
from pathlib import Path

import pytest
from selfdrive.controls.lib.long_mpc import LEAD_DECAY, NODE_STEPS, LongitudinalMpc
from selfdrive.messages import LeadData

REPO = Path(__file__).parents[4]
TRACES = Path(os.environ.get("OPENPILOT_TRACES", REPO.parent / "shared/reference/openpilot_v0.4.2/traces"))

DT_PLAN = 0.05  # s
HORIZON = 0.2  # s, of v_mpc and a_mpc


def drive(mpc, v, a, lead, times):
    for _ in range(times):
        mpc.set_cur_state(v, a)
        mpc.update(v, a, lead)


def results(mpc):
    scalars = (mpc.v_mpc, mpc.a_mpc, mpc.v_mpc_future, mpc.prev_lead_status, mpc.new_lead)
    plans = (mpc.x_plan, mpc.v_plan, mpc.a_plan, mpc.x_lead_plan)
    return [repr(value) for value in scalars] + [plan.tobytes() for plan in plans]


@pytest.fixture
def stop():
    """Leads and plans of openpilot's run in S5, from 7.5 s to 22 s at 20 Hz.

    A lead is (distance, speed, acceleration), a plan (speed, acceleration). The lead's speed is the relative
    speed plus the car's speed 0.1 s before, two rows up, because of the radar's delay.
    """
    path = TRACES / "S5.csv"
    if not path.exists():
        pytest.skip(f"no recorded run {path}; set OPENPILOT_TRACES to the folder that holds S5.csv")
    with path.open() as f:
        rows = list(csv.DictReader(f))
    leads, plans = [], []
    for before, row in zip(rows, rows[2:], strict=False):
        if 7.5 <= float(row["time"]) <= 22.0:
            v_lead = float(row["lead_vRel"]) + float(before["vEgo"])
            leads.append((float(row["lead_dRel"]), v_lead, float(row["lead_aLeadK"])))
            plans.append((float(row["plan_vTarget"]), float(row["plan_aTarget"])))
    return leads, plans


def test_the_plan_equals_the_recording_of_openpilot(long_mpc, lead, stop):
    """With the same leads, the plan agrees with that of openpilot v0.4.2 through a whole stop."""
    leads, plans = stop
    (v, a), (_, a_next) = plans[:2]
    a -= 0.2 * (a_next - a)
    v -= 0.01 * a  # the record is 10 ms into each plan
    drive(long_mpc, v, a, lead(*leads[0]), 10)  # openpilot had followed this lead for some time
    off_v, off_a = 0.0, 0.0
    for seen, (v_plan, a_plan) in zip(leads, plans, strict=True):
        drive(long_mpc, v, a, lead(*seen), 1)
        rate = (long_mpc.a_mpc - a) / HORIZON
        a_now = a + 0.01 * rate
        off_v = max(off_v, abs(v + 0.005 * (a + a_now) - v_plan))
        off_a = max(off_a, abs(a_now - a_plan))
        v += DT_PLAN * (a + DT_PLAN * rate / 2)
        a += DT_PLAN * rate
    assert len(plans) == 291
    assert v == pytest.approx(0.0, abs=0.01)
    assert off_v < 0.005
    assert off_a < 0.005


@pytest.mark.parametrize("v", [0.0, 5.0, 15.0, 30.0])
def test_the_plan_keeps_the_speed_at_the_steady_gap(long_mpc, lead, v):
    """The steady gap is 4 m plus the distance driven in 1.8 s."""
    drive(long_mpc, v, 0.0, lead(4.0 + 1.8 * v, v), 20)
    assert long_mpc.a_mpc == pytest.approx(0.0, abs=1e-6)
    assert list(long_mpc.v_plan) == pytest.approx([v] * 21, abs=1e-4)


@pytest.mark.parametrize(("gap", "sign"), [(30.0, -1), (60.0, 1)])
def test_the_plan_reduces_the_error_of_the_gap(long_mpc, lead, gap, sign):
    drive(long_mpc, 20.0, 0.0, lead(gap, 20.0), 20)
    assert long_mpc.a_mpc * sign > 0.01
    assert (long_mpc.v_mpc_future - 20.0) * sign > 0.1


def test_without_a_lead_the_plan_does_not_limit_the_speed(long_mpc):
    drive(long_mpc, 20.0, 0.0, None, 20)
    assert not long_mpc.prev_lead_status
    assert long_mpc.v_mpc_future > 20.0
    drive(long_mpc, 20.0, 0.0, LeadData(), 1)
    assert not long_mpc.prev_lead_status


def test_a_lead_is_new_when_it_appears_or_jumps(long_mpc, lead):
    seen = []
    for d_rel in (50.0, 49.0, 51.5, 54.1, 54.1):
        drive(long_mpc, 20.0, 0.0, lead(d_rel, 18.0), 1)
        seen.append(long_mpc.new_lead)
    drive(long_mpc, 20.0, 0.0, None, 1)
    assert not long_mpc.new_lead
    drive(long_mpc, 20.0, 0.0, lead(54.1, 18.0), 1)
    assert [*seen, long_mpc.new_lead] == [True, False, False, True, False, True]


@pytest.mark.parametrize(("v", "a"), [(0.09, 0.0), (2.0, -4.1), (-3.0, 0.0)])
def test_a_very_slow_or_hard_braking_lead_is_planned_as_stopped(long_mpc, lead, v, a):
    drive(long_mpc, 5.0, 0.0, lead(30.0, v, a), 1)
    assert list(long_mpc.x_lead_plan) == [30.0] * 21


def test_a_braking_lead_stops_but_does_not_reverse(long_mpc, lead):
    drive(long_mpc, 5.0, 0.0, lead(30.0, 2.0, -3.9), 1)
    steps = [b - a for a, b in zip(long_mpc.x_lead_plan, long_mpc.x_lead_plan[1:], strict=False)]
    assert min(steps) > -0.01
    assert steps[-1] == pytest.approx(0.0, abs=0.01)


def test_decay_of_the_leads_acceleration(long_mpc, lead):
    """The decay is 1.5/s while the lead's acceleration is small.

    Otherwise, it falls by a tenth with each update.
    """

    def travelled(decay):
        x, v, a, h = 0.0, 10.0, 1.0, 0.2
        for _ in range(50):
            z = decay * h
            x += h * v + h * h * a * (1 / 2 - z / 6 + z * z / 24)
            v += h * a * (1 - z / 2 + z * z / 6 - z**3 / 24)
            a *= 1 - z + z * z / 2 - z**3 / 6 + z**4 / 24
        return x

    drive(long_mpc, 10.0, 0.0, lead(40.0, 10.0, 0.49), 3)
    for k in range(1, 4):
        drive(long_mpc, 10.0, 0.0, lead(40.0, 10.0, 1.0), 1)
        assert long_mpc.x_lead_plan[-1] - 40.0 == pytest.approx(travelled(LEAD_DECAY * 0.9**k), abs=1e-9)
    drive(long_mpc, 10.0, 0.0, lead(40.0, 10.0, 0.0), 1)
    drive(long_mpc, 10.0, 0.0, lead(40.0, 10.0, 1.0), 1)
    assert long_mpc.x_lead_plan[-1] - 40.0 == pytest.approx(travelled(LEAD_DECAY * 0.9), abs=1e-9)


def test_the_plan_for_a_new_lead_depends_only_on_the_planned_speed(make_long, lead):
    one, other = make_long(), make_long()
    drive(one, 20.0, 0.0, lead(20.0, 5.0), 5)
    drive(other, 25.0, 0.0, None, 3)
    one.v_mpc = other.v_mpc = 21.0
    for mpc in (one, other):
        drive(mpc, 20.0, 0.0, lead(80.0, 10.0), 1)
    assert results(one) == results(other)


def test_a_plan_through_the_lead_is_discarded(long_mpc, lead):
    drive(long_mpc, 20.0, 0.0, lead(30.0, 20.0), 3)
    long_mpc.set_cur_state(20.0, 0.0)
    long_mpc.update(19.5, -0.3, lead(-51.0, 20.0))
    assert long_mpc.resets == 1
    assert (long_mpc.v_mpc, long_mpc.a_mpc) == (19.5, -0.3)
    assert not long_mpc.prev_lead_status
    drive(long_mpc, 20.0, 0.0, lead(30.0, 20.0), 1)
    assert long_mpc.new_lead
    assert long_mpc.prev_lead_status


class FixedSolution:
    """An iteration whose solution drives 10 m/s behind a lead 20 m ahead, except at one node."""

    unsolved = 0

    def __init__(self, node, gap=20.0, speed=10.0):
        z = [value for _ in range(21) for value in (0.0, 10.0, 0.0, 20.0, 10.0, 0.0)]
        z[6 * node + 1], z[6 * node + 3] = speed, gap
        self.guess = array("d", z + [0.0] * 20)
        self.solution = self.guess

    def run(self, start, param):
        return True

    def restart(self, nodes=None):
        pass


@pytest.mark.parametrize("node", range(21))
def test_a_plan_is_checked_between_its_first_and_last_node(long_mpc, lead, node):
    """The original checks nodes 1 to 19, each for a gap below -50 m and for a speed below -0.01 m/s."""
    for change, bad in (({"gap": -50.1}, True), ({"gap": -49.9}, False), ({"speed": -0.011}, True)):
        long_mpc.reset()
        long_mpc._iteration = FixedSolution(node, **change)
        drive(long_mpc, 10.0, 0.0, None, 1)
        assert long_mpc.resets == 0
        drive(long_mpc, 10.0, 0.0, lead(20.0, 10.0), 1)
        assert long_mpc.resets == int(bad and 1 <= node <= 19)


@pytest.mark.parametrize("v", [-0.009, 0.0, 0.05])
@pytest.mark.parametrize("a", [-3.0, -0.5, 0.0])
@pytest.mark.parametrize("d_rel", [0.0, 3.0, 6.0])
def test_standstill_is_feasible(long_mpc, lead, v, a, d_rel):
    drive(long_mpc, v, a, lead(d_rel, 0.0), 10)
    assert long_mpc.unsolved == long_mpc.resets == 0
    assert min(long_mpc.v_plan[1:]) > -1e-5


@pytest.mark.parametrize("field", ["d_rel", "v_lead", "a_lead_k"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_lead_with_nan_raises_no_error(long_mpc, lead, field, value):
    broken = lead(30.0, 20.0)
    setattr(broken, field, value)
    drive(long_mpc, 20.0, 0.0, broken, 3)
    assert math.isfinite(long_mpc.v_mpc)
    drive(long_mpc, 20.0, 0.0, lead(40.0, 20.0), 2)
    assert long_mpc.prev_lead_status
    assert math.isfinite(long_mpc.a_mpc)


def test_a_solution_with_nan_is_discarded(long_mpc, lead):
    drive(long_mpc, 20.0, 0.0, lead(40.0, 20.0), 2)
    before = long_mpc.a_plan.tobytes()
    long_mpc.update(19.0, 0.1, lead(math.nan, 20.0))
    assert long_mpc.resets == 1
    assert (long_mpc.v_mpc, long_mpc.a_mpc) == (19.0, 0.1)
    assert long_mpc.a_plan.tobytes() == before
    assert not long_mpc.prev_lead_status


def test_any_input_gives_a_result(make_long, lead):
    rng = random.Random(1)
    mpc = make_long()
    for _ in range(500):
        mpc.set_cur_state(rng.uniform(-20, 90), rng.uniform(-30, 30))
        seen = lead(rng.uniform(-300, 300), rng.uniform(-100, 100), rng.uniform(-50, 50))
        mpc.update(rng.uniform(0, 90), rng.uniform(-9, 9), rng.choice((seen, None)))
        assert math.isfinite(mpc.v_mpc + mpc.a_mpc + mpc.v_mpc_future)


def test_a_reset_instance_behaves_like_a_new_one(make_long, lead):
    used, fresh = make_long(), make_long()
    drive(used, 20.0, -1.0, lead(15.0, 5.0, -4.0), 5)
    drive(used, math.nan, 0.0, lead(15.0, 5.0), 1)
    drive(used, -5.0, -9.0, lead(1.0, 0.0), 2)
    used.reset()
    assert results(used) == results(fresh)
    for k in range(40):
        for mpc in (used, fresh):
            drive(mpc, 20.0 - 0.1 * k, -2.0, lead(40.0 - k, 15.0, -1.0), 1)
        assert results(used) == results(fresh)


def test_a_discarded_plan_has_no_later_effect(make_long, lead):
    one, other = make_long(), make_long()
    one.update(20.0, 0.0, lead(math.nan, 20.0))
    drive(other, 20.0, 0.0, lead(40.0, 20.0), 5)
    other.update(20.0, 0.0, lead(-100.0, 20.0))
    assert one.resets == other.resets == 1
    for _ in range(5):
        for mpc in (one, other):
            drive(mpc, 20.0, 0.0, lead(40.0, 20.0), 1)
        assert results(one) == results(other)


def test_a_shared_solver_has_no_state(long_solver, lead):
    together = [LongitudinalMpc(i, long_solver) for i in (1, 2)]
    alone = [LongitudinalMpc(i) for i in (1, 2)]
    leads = (lead(30.0, 15.0), lead(60.0, 25.0, -1.0))
    for _ in range(5):
        for mpcs in (together, alone):
            for mpc, seen in zip(mpcs, leads, strict=True):
                drive(mpc, 20.0, 0.0, seen, 1)
    assert [results(mpc) for mpc in together] == [results(mpc) for mpc in alone]


def test_the_plan_has_21_nodes_over_10_s():
    assert pytest.approx((0.2,) * 5 + (0.6,) * 15) == NODE_STEPS
