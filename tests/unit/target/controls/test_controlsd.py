"""The control loop with a fake car."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from selfdrive.common.car import CarParams
from selfdrive.common.conversions import KPH_TO_MS
from selfdrive.controls.controlsd import Controlsd
from selfdrive.controls.lib import events as ev
from selfdrive.controls.lib.events import Event
from selfdrive.controls.lib.pathplanner import ModelFit
from selfdrive.messages import (
    ButtonEvent,
    CarControl,
    CarState,
    LeadData,
    LeadVision,
    ModelData,
    PathData,
    RadarState,
)

ENGAGE = Event("button_enable", (ev.ENABLE,))
GAS = Event("pedal_pressed", (ev.PRE_ENABLE,))
CAN = Event("can_error", (ev.NO_ENTRY, ev.IMMEDIATE_DISABLE))
BUSY = Event("steer_temp_unavailable", (ev.NO_ENTRY, ev.WARNING))
BROKEN = Event("steer_unavailable", (ev.NO_ENTRY, ev.IMMEDIATE_DISABLE, ev.PERMANENT))
RELEASE = (ButtonEvent("decel", False),)


class FakeCar:
    def __init__(self) -> None:
        self.state = CarState()
        self.asked: list[CarControl] = []
        self.frames: list[int] = []

    def update(self, frames: list, t: float) -> CarState:
        return self.state

    def apply(self, control: CarControl, frame: int) -> list:
        self.asked.append(control)
        self.frames.append(frame)
        return [frame]


class FreeMpc:
    prev_lead_status = new_lead = False
    v_mpc = v_mpc_future = 99.0
    a_mpc = 0.0
    a_plan = (0.0,) * 21

    def set_cur_state(self, v: float, a: float) -> None: ...

    def update(self, v_ego: float, a_ego: float, lead: LeadData) -> None: ...


class Drive:
    """controlsd at 20 m/s in the middle of a straight lane, with radar and camera alive."""

    def __init__(self, params: CarParams) -> None:
        self.car = FakeCar()
        self.controlsd = Controlsd(params, self.car, ModelFit())
        planner = self.controlsd._planner
        planner.mpc1 = planner.mpc2 = FreeMpc()
        self.controlsd._lateral.mpc = SimpleNamespace(update=lambda *_: 0.1)
        self.frame = -1
        self.run(5)

    def run(self, cycles: int = 1, *events: Event, **car) -> "Drive":
        for _ in range(cycles):
            self.frame += 1
            t = self.frame * 0.01
            self.car.state = CarState(**{"t": t, "v_ego": 20.0, "events": events, **car})
            if self.frame % 5 == 0:
                lines = [PathData((y,) * 50, 1.0, 1.0) for y in (0.5, 2.35, -1.35)]
                self.model = ModelData(t, *lines, LeadVision(99.0, 1.0, 0.1))
                self.radar = RadarState(t, LeadData(), LeadData())
            self.sent = self.controlsd.update(t, [], self.radar, self.model)
        return self

    def engage(self) -> "Drive":
        return self.run(1, ENGAGE, buttons=RELEASE)

    @property
    def state(self):
        return self.controlsd.state

    @property
    def asked(self) -> CarControl:
        return self.car.asked[-1]


@pytest.fixture
def drive(params: CarParams) -> Drive:
    return Drive(params)


def test_engaging_sets_the_speed_and_takes_over(drive: Drive) -> None:
    drive.engage()
    assert (drive.state.state, drive.state.enabled, drive.state.active) == ("enabled", True, True)
    assert drive.state.long_state == "pid"
    assert drive.asked.enabled and drive.asked.set_speed == pytest.approx(72 * KPH_TO_MS)
    assert drive.state.alerts[0] == "enable"


def test_a_disengaged_car_gets_zero_commands(drive: Drive) -> None:
    """A set speed of 255 km/h means that none is set."""
    actuators = drive.asked.actuators
    assert (actuators.gas, actuators.brake, actuators.steer) == (0.0, 0.0, 0.0)
    assert not drive.asked.enabled and drive.asked.cancel_cruise
    assert drive.state.v_cruise == pytest.approx(255 * KPH_TO_MS)


def test_engaged_control_commands_torque_and_gas(drive: Drive) -> None:
    drive.engage().run(30, v_ego=19.0)
    assert drive.asked.actuators.steer == 1.0
    assert drive.asked.actuators.gas > 0.05


def test_an_immediate_fault_zeroes_the_actuators_in_the_same_cycle(drive: Drive) -> None:
    drive.engage().run(30, v_ego=19.0).run(1, CAN, v_ego=19.0)
    actuators = drive.asked.actuators
    assert (actuators.gas, actuators.brake, actuators.steer) == (0.0, 0.0, 0.0)
    assert (drive.state.enabled, drive.state.long_state) == (False, "off")
    assert drive.state.alerts[0] == "can_error" and drive.state.events == ("can_error",)
    drive.run(100)
    assert not drive.state.enabled


def test_control_waits_until_the_gas_pedal_is_released(drive: Drive) -> None:
    drive.run(1, ENGAGE, GAS, buttons=RELEASE)
    assert (drive.state.state, drive.state.active, drive.state.long_state) == ("pre_enabled", False, "off")
    drive.run(1)
    assert drive.state.long_state == "pid"


def test_buttons_change_the_set_speed_once_engaged(drive: Drive) -> None:
    drive.engage()
    assert drive.state.v_cruise == pytest.approx(72 * KPH_TO_MS)
    drive.run(1, buttons=(ButtonEvent("accel", True),)).run(1, ENGAGE, buttons=(ButtonEvent("accel", False),))
    assert drive.state.v_cruise == pytest.approx(80 * KPH_TO_MS)


def test_lost_messages_disengage(drive: Drive) -> None:
    drive.engage()
    for _ in range(60):
        drive.frame += 1
        drive.controlsd.update(drive.frame * 0.01, [], drive.radar, drive.model)
        if not drive.state.enabled:
            break
    assert {"model_error", "radar_error"} <= set(drive.state.alerts)
    assert drive.frame * 0.01 == pytest.approx(drive.model.t + 0.51)


def test_braking_while_the_plan_accelerates_disengages(drive: Drive) -> None:
    drive.engage().run(1, brake_pressed=True)
    assert not drive.state.enabled and drive.state.alerts[0] == "no_target"


def test_steer_saturation_raises_an_alert_and_control_continues(drive: Drive) -> None:
    drive.engage().run(78)
    assert "steer_saturated" not in drive.state.alerts
    drive.run(5)
    assert drive.state.alerts[0] == "steer_saturated" and drive.state.enabled and drive.state.steer_saturated


def test_car_parameters_can_switch_off_the_saturation_alert(params: CarParams) -> None:
    drive = Drive(replace(params, steer_limit_alert=False)).engage().run(100)
    assert drive.state.steer_saturated and "steer_saturated" not in drive.state.alerts


def test_buttons_do_not_set_a_speed_while_disengaged(drive: Drive) -> None:
    drive.run(1, buttons=(ButtonEvent("decel", False),))
    assert drive.state.v_cruise == pytest.approx(255 * KPH_TO_MS)


def test_the_car_slows_down_if_the_driver_is_inactive(drive: Drive) -> None:
    drive.engage()
    drive.controlsd._awareness.status = -0.01
    drive.run(300)
    assert drive.controlsd.plan.a_target == pytest.approx(-0.2, abs=0.01)
    assert drive.state.alerts[0] == "driver_distracted"


def test_warnings_need_engagement_and_permanent_alerts_do_not(drive: Drive) -> None:
    drive.run(1, BUSY)
    assert "steer_temp_unavailable" not in drive.state.alerts
    drive.run(1, BROKEN)
    assert "steer_unavailable_permanent" in drive.state.alerts
    drive.run(100).engage().run(1, BUSY)
    assert "steer_temp_unavailable" in drive.state.alerts


def test_the_collision_warning_works_while_disengaged(drive: Drive) -> None:
    drive.controlsd._planner._fcw_checker = SimpleNamespace(update=lambda *_: True, reset=lambda: None)
    drive.run(5)
    assert drive.state.alerts[0] == "fcw" and not drive.state.enabled
    assert (drive.asked.visual_alert, drive.asked.audible_alert) == ("fcw", "chime_repeated")


def test_driver_actions_restart_the_inactivity_timer(drive: Drive) -> None:
    drive.engage().run(100)
    awareness = drive.controlsd._awareness
    assert awareness.status < 1.0
    drive.run(1, steering_pressed=True)
    assert awareness.status == 1.0
    drive.run(100).run(1, buttons=(ButtonEvent("setting", True),))
    assert awareness.status == 1.0
    drive.run(100).run(1, CAN)
    assert awareness.status == 1.0 and not drive.state.enabled


def test_the_dashboard_shows_a_lead_while_the_plan_follows_one(drive: Drive) -> None:
    drive.engage()
    assert not drive.asked.lead_visible
    drive.controlsd._planner.mpc1.prev_lead_status = True
    assert drive.run(1).asked.lead_visible


def test_the_angle_offset_is_learnt_while_engaged(drive: Drive) -> None:
    offset = drive.controlsd._angle_offset
    drive.run(20)
    assert offset.value == 0.0
    drive.engage().run(20, steering_pressed=True)
    assert offset.value == 0.0
    drive.run(5)
    once = offset.value
    assert once > 0.0
    drive.run(10)
    assert offset.value == pytest.approx(3 * once, rel=1e-3)


def test_the_lateral_mpc_gets_the_learnt_angle_offset(drive: Drive) -> None:
    told = []
    drive.controlsd._lateral.mpc.update = lambda *arguments: told.append(arguments[3]) or 0.1
    drive.controlsd._angle_offset.value = 0.02
    drive.run(5)
    assert told == [0.02]


def test_frames_are_counted_and_passed_on(drive: Drive) -> None:
    assert drive.car.frames == [0, 1, 2, 3, 4]
    assert drive.sent == [4]


def test_the_startup_text_is_shown_for_15_s(drive: Drive) -> None:
    assert drive.state.alerts == ("startup",) and drive.state.alert_text1 != ""
    drive.run(1490)
    assert drive.state.alerts == ("startup",)
    drive.run(10)
    assert drive.state.alerts == () and drive.state.alert_text1 == ""
