"""The effect of a step in the radar's relative speed on the lead's history and the collision warning. We
measured on openpilot v0.4.2 that a distance jump of more than 2.5 m or a lost lead resets everything. A jump
of the relative speed resets nothing, unless the plan cannot follow it."""

from typing import NamedTuple

import pytest
from selfdrive.common.car import CarParams
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.controls.plannerd import Planner
from selfdrive.controls.radard import Radard
from selfdrive.messages import (
    CarState,
    ControlsState,
    LeadVision,
    ModelData,
    PathData,
    RadarData,
    RadarPoint,
    RadarState,
)

V_EGO = 25.0
CYCLE = 0.05  # s
STRAIGHT = [PathData((y,) * 50, 1.0, 1.0) for y in (0.0, 1.85, -1.85)]


class Cycle(NamedTuple):
    state: RadarState
    fusions: int
    new_lead: bool
    fcw: bool


def drive(params: CarParams, v_rel: list[float], gap: float = 60.0, jump: float = 0.0) -> list[Cycle]:
    """Run radard and planner, not engaged, behind a lead with these relative speeds. `jump` is added to the
    lead's distance while the speed differs from the first one."""
    radard, planner = Radard(params, ModelFit()), Planner(params, ModelFit())
    car, controls = CarState(v_ego=V_EGO), ControlsState(v_ego=V_EGO, active=True)
    found, true = [], v_rel[0]
    for k, speed in enumerate(v_rel):
        t = CYCLE * k
        gap = max(gap + true * CYCLE, 1.0)
        seen = gap + jump * (speed != true)
        model = ModelData(t, *STRAIGHT, LeadVision(gap, 1.0, 0.95))
        state = radard.update(RadarData(t, (RadarPoint(1, seen, 0.0, speed),)), model, controls)
        planner.take_model(V_EGO, model)
        plan = planner.update(t, car, state, "off", 90.0, False)
        (track,) = radard._tracks.values()
        found.append(Cycle(state, track.fusions, planner.mpc1.new_lead, plan.fcw))
    return found


def test_a_speed_step_resets_nothing(params: CarParams) -> None:
    found = drive(params, [-2.0] * 60 + [18.0] * 40 + [-2.0] * 40)
    assert not any(cycle.new_lead for cycle in found[10:])
    before, after, settled = (found[k].state.lead_one for k in (59, 60, 99))
    assert after.v_lead - before.v_lead == pytest.approx(20.0)
    assert after.v_lead_k - before.v_lead_k == pytest.approx(0.1988689 * 20.0, rel=0.05)
    assert settled.v_lead_k == pytest.approx(43.0, abs=1.0)


def test_fusions_pause_while_the_camera_disagrees(params: CarParams) -> None:
    found = drive(params, [-2.0] * 60 + [18.0] * 40 + [-2.0] * 40)
    assert found[59].fusions >= 20 and found[59].state.lead_one.fcw
    assert found[99].fusions == found[59].fusions and found[99].state.lead_one.fcw
    assert found[139].fusions == found[59].fusions + 40


def test_a_warning_needs_half_a_second_after_the_step(params: CarParams) -> None:
    found = drive(params, [-2.0] * 80 + [-10.0] * 40, gap=30.0)
    assert not any(cycle.new_lead for cycle in found[10:])
    assert [k for k, cycle in enumerate(found) if cycle.fcw] == [89]


def test_a_step_that_the_plan_cannot_follow_resets_the_lead(params: CarParams) -> None:
    """The longest counter of the warning, 3 s without a blinker, restarts."""
    found = drive(params, [-2.0] * 80 + [-20.0] * 80, gap=50.0)
    assert [k for k, cycle in enumerate(found) if cycle.new_lead and k >= 80] == [81]
    assert [k for k, cycle in enumerate(found) if cycle.fcw] == [81 + 60]


def test_a_jump_of_the_distance_resets_the_lead(params: CarParams) -> None:
    """The warning's counters (30 cycles of detection, 3 s without a blinker) restart."""
    found = drive(params, [-2.0] * 80 + [-18.0] * 40, jump=-3.0)
    assert found[80].new_lead
    assert not any(cycle.fcw for cycle in found[: 80 + 30])
