"""Selecting and interpolating the longitudinal plan."""

from itertools import pairwise
from types import SimpleNamespace

import pytest
from selfdrive.common.car import CarParams
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.controls.plannerd import Planner
from selfdrive.messages import CarState, LeadData, LeadVision, ModelData, PathData, Plan, RadarState


class FixedMpc:
    def __init__(self, dv: float = 1.0, a: float = 0.0, lead: bool = False, future: float = 99.0) -> None:
        self.dv, self.a_mpc, self.prev_lead_status, self.v_mpc_future = dv, a, lead, future
        self.new_lead = False
        self.a_plan = (0.0,) * 21
        self.start = (0.0, 0.0)

    def set_cur_state(self, v: float, a: float) -> None:
        self.start = (v, a)
        self.v_mpc = v + self.dv

    def update(self, v_ego: float, a_ego: float, lead: LeadData) -> None:
        self.lead = lead


class Drive:
    """A planner at 20 m/s whose MPCs return fixed solutions."""

    def __init__(self, params: CarParams, mpc1: FixedMpc | None = None, mpc2: FixedMpc | None = None) -> None:
        self.planner = Planner(params, ModelFit())
        self.planner.mpc1, self.planner.mpc2 = mpc1 or FixedMpc(), mpc2 or FixedMpc()
        self.car = CarState(v_ego=20.0, a_ego=0.3)
        self.lead = LeadData()
        self.frame = -1

    def run(
        self,
        cycles: int,
        long_state: str = "pid",
        kph: float = 72.0,
        slow_down: bool = False,
        radar: bool = True,
    ) -> list[Plan]:
        plans = []
        for _ in range(cycles):
            self.frame += 1
            t = self.frame * 0.01
            if radar and self.frame % 5 == 0:
                self.state = RadarState(t, self.lead, LeadData())
                self.model = ModelData(
                    t, *([PathData((0.0,) * 50, 1.0, 1.0)] * 3), LeadVision(99.0, 1.0, 0.1)
                )
            self.planner.take_model(20.0, self.model)
            plans.append(self.planner.update(t, self.car, self.state, long_state, kph, slow_down))
        return plans


def started(params: CarParams, *mpcs: FixedMpc) -> Drive:
    drive = Drive(params, *mpcs)
    drive.run(5, "off")
    return drive


def test_while_off_the_plan_starts_from_the_cars_speed(params: CarParams) -> None:
    drive = Drive(params)
    plan = drive.run(1, "off")[-1]
    assert (plan.v_target, plan.a_target, plan.source) == (20.0, 0.0, "cruise")
    drive.car = CarState(v_ego=19.0, a_ego=-0.5)
    assert drive.run(5, "off")[-1].v_target == pytest.approx(18.995)


def test_moving_off_starts_at_walking_pace(params: CarParams) -> None:
    drive = Drive(params)
    drive.car = CarState(v_ego=0.0)
    plan = drive.run(1, "starting")[-1]
    assert (plan.v_target, plan.a_target) == (pytest.approx(0.305), 0.5)


def test_cruise_stays_within_the_jerk_and_acceleration_limits(params: CarParams) -> None:
    plans = started(params).run(500, kph=100.0)
    steps = [after.a_target - before.a_target for before, after in pairwise(plans)]
    assert max(steps) <= 0.5 * 0.01 * 1.5
    assert max(p.a_target for p in plans) == pytest.approx(0.5, abs=0.01)


def test_turns_lower_the_planned_acceleration(params: CarParams) -> None:
    """At 20 m/s, 1.88 m/s^2 of lateral acceleration leave 0.27 m/s^2 of the total of 1.9 m/s^2."""
    drive = started(params)
    angle = 1.88 / 20.0**2 * params.steer_ratio * params.wheelbase
    drive.car = CarState(v_ego=20.0, a_ego=0.3, steering_angle=angle)
    assert max(plan.a_target for plan in drive.run(300, kph=100.0)) == pytest.approx(0.275, abs=0.01)


def test_following_a_lead_allows_more_acceleration(params: CarParams) -> None:
    drive = started(params)
    drive.lead = LeadData(status=True, d_rel=30.0, v_lead=22.0, v_lead_k=22.0, a_lead_k=0.5)
    assert max(plan.a_target for plan in drive.run(300, kph=100.0)) == pytest.approx(0.7, abs=0.01)


def test_the_cruise_speed_is_never_negative(params: CarParams) -> None:
    drive = started(params)
    drive.planner._v_now, drive.planner._a_now = -0.005, -0.4
    drive.run(1, kph=8.0)
    assert drive.planner._v_cruise == 0.0


def test_the_slowest_plan_is_selected(params: CarParams) -> None:
    """An MPC's plan is considered only if it has a lead."""
    slow, slower = FixedMpc(-0.1, -0.5, True), FixedMpc(-0.2, -1.0, True)
    assert started(params, slow, slower).run(1)[-1].source == "mpc2"
    assert started(params, slower, slow).run(1)[-1].source == "mpc1"
    assert started(params, FixedMpc(-0.2, -1.0, False), slow).run(1)[-1].source == "mpc2"
    assert started(params, FixedMpc(+0.5, 0.5, True)).run(1)[-1].source == "cruise"


def test_the_plan_is_interpolated_and_the_next_one_starts_from_it(params: CarParams) -> None:
    mpc = FixedMpc(-0.1, -1.0, True)
    drive = started(params, mpc)
    plans = drive.run(6)
    assert [p.a_target for p in plans[:5]] == pytest.approx([-0.05, -0.10, -0.15, -0.20, -0.25])
    assert mpc.start == pytest.approx((plans[4].v_target, -0.25))
    # speed is the integral of that acceleration
    assert plans[4].v_target - plans[0].v_target == pytest.approx(-0.25 * 0.05 / 2 + 0.05 * 0.01 / 2)


def test_a_plan_that_is_not_renewed_stops_changing(params: CarParams) -> None:
    drive = started(params, FixedMpc(-0.1, -1.0, True))
    targets = [plan.a_target for plan in drive.run(1) + drive.run(40, radar=False)]
    assert targets[:22] == sorted(set(targets), reverse=True)
    assert targets[22:] == [targets[21]] * 19


def test_the_future_speed_is_the_lowest_of_both_mpcs_and_the_set_speed(params: CarParams) -> None:
    assert Drive(params, FixedMpc(future=12.0)).run(1)[-1].v_target_future == 12.0
    assert Drive(params, FixedMpc(), FixedMpc(future=11.0)).run(1)[-1].v_target_future == 11.0
    assert Drive(params).run(1, kph=36.0)[-1].v_target_future == pytest.approx(10.0)


def test_an_absent_driver_slows_the_car(params: CarParams) -> None:
    assert started(params).run(200, kph=100.0, slow_down=True)[-1].a_target == pytest.approx(-0.2, abs=0.01)


def errors(drive: Drive, plans: list[Plan]) -> dict[str, int]:
    first: dict[str, int] = {}
    for k, plan in enumerate(plans):
        for event in plan.events:
            first.setdefault(event.name, k)
    return first


def test_messages_older_than_half_a_second_are_an_error(params: CarParams) -> None:
    drive = Drive(params)
    plans = drive.run(1) + drive.run(60, radar=False)
    assert errors(drive, plans) == {"model_error": 51, "radar_error": 51}


def test_missing_messages_are_an_error(params: CarParams) -> None:
    plan = Planner(params, ModelFit()).update(0.1, CarState(), None, "off", 255.0, False)
    assert [event.name for event in plan.events] == ["model_error", "radar_error"]


def test_radar_errors_raise_an_event_at_once(params: CarParams) -> None:
    drive = Drive(params)
    drive.run(1)
    state = RadarState(0.01, LeadData(), LeadData(), ("fault",))
    plan = drive.planner.update(0.01, drive.car, state, "pid", 72.0, False)
    assert [event.name for event in plan.events] == ["radar_error"]


def test_collision_warnings_are_passed_on_unless_the_driver_brakes(params: CarParams) -> None:
    drive = Drive(params)
    resets = []
    drive.planner._fcw_checker = SimpleNamespace(update=lambda *_: True, reset=lambda: resets.append(1))
    assert drive.run(1)[-1].fcw and not resets
    drive.planner.mpc1.new_lead = True
    drive.car = CarState(v_ego=20.0, brake_pressed=True)
    assert not drive.run(5)[-1].fcw and resets == [1]
