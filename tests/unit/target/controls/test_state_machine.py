"""Control states and the events that change them."""

import pytest
from selfdrive.controls.lib import events as ev
from selfdrive.controls.lib.alertmanager import AlertManager
from selfdrive.controls.lib.events import Event
from selfdrive.controls.lib.state_machine import StateMachine

ENGAGE = Event("button_enable", (ev.ENABLE,))
GAS = Event("pedal_pressed", (ev.PRE_ENABLE,))
BRAKE = Event("pedal_pressed", (ev.NO_ENTRY, ev.USER_DISABLE))
DOOR = Event("door_open", (ev.NO_ENTRY, ev.SOFT_DISABLE))
CAN = Event("can_error", (ev.NO_ENTRY, ev.IMMEDIATE_DISABLE))


class Drive:
    def __init__(self, *steps: tuple[Event, ...]) -> None:
        self.machine = StateMachine()
        self.alerts = AlertManager()
        self.t = 0.0
        for events in steps:
            self.step(*events)

    def step(self, *events: Event) -> bool:
        self.t += 0.01
        engaged = self.machine.update(events, self.alerts, self.t)
        self.alerts.process(self.t)
        return engaged

    @property
    def state(self) -> str:
        return self.machine.state


@pytest.mark.parametrize(
    ("events", "state"),
    [
        ((), "disabled"),
        ((ENGAGE,), "enabled"),
        ((ENGAGE, GAS), "pre_enabled"),
        ((ENGAGE, BRAKE), "disabled"),
        ((ENGAGE, DOOR), "disabled"),
        ((ENGAGE, CAN), "disabled"),
        ((GAS,), "disabled"),
    ],
)
def test_a_button_engages_unless_an_event_prevents_it(events: tuple[Event, ...], state: str) -> None:
    drive = Drive()
    assert drive.step(*events) == (state != "disabled")
    assert drive.state == state


def test_a_refused_engagement_shows_the_reasons() -> None:
    assert Drive((ENGAGE, DOOR, CAN)).alerts.active == ("door_open_no_entry", "can_error_no_entry")


@pytest.mark.parametrize(
    ("first", "event", "state", "alert"),
    [
        ((ENGAGE,), BRAKE, "disabled", "disable"),
        ((ENGAGE,), CAN, "disabled", "can_error"),
        ((ENGAGE,), DOOR, "soft_disabling", "door_open"),
        ((ENGAGE, GAS), BRAKE, "disabled", "disable"),
        ((ENGAGE, GAS), CAN, "disabled", "can_error"),
        ((ENGAGE, GAS), DOOR, "disabled", "door_open"),
    ],
)
def test_events_that_disengage(first: tuple[Event, ...], event: Event, state: str, alert: str) -> None:
    drive = Drive(first, (event,))
    assert drive.state == state
    assert alert in drive.alerts.active


def test_control_becomes_active_when_the_gas_pedal_is_released() -> None:
    drive = Drive((ENGAGE, GAS), (GAS,))
    assert drive.machine.enabled and not drive.machine.active
    drive.step()
    assert drive.machine.active


def test_the_driver_takes_precedence_over_a_fault() -> None:
    assert Drive((ENGAGE,), (CAN, BRAKE)).alerts.active[0] == "disable"


def test_control_stays_active_for_300_cycles_of_soft_disabling() -> None:
    drive = Drive((ENGAGE,), (DOOR,))
    active = []
    for _ in range(310):
        drive.step(DOOR)
        active.append(drive.machine.active)
    assert active == [True] * 299 + [False] * 11


def test_soft_disabling_ends_with_its_reason() -> None:
    drive = Drive((ENGAGE,), (DOOR,), (DOOR,), ())
    assert drive.state == "enabled"
    for _ in range(300):
        drive.step(DOOR)
    assert drive.state == "soft_disabling"


def test_a_fault_ends_soft_disabling() -> None:
    assert Drive((ENGAGE,), (DOOR,), (DOOR, CAN)).state == "disabled"


def test_the_car_does_not_re_engage_by_itself() -> None:
    drive = Drive((ENGAGE,), (CAN,), (), ())
    assert drive.state == "disabled"
    assert drive.step(ENGAGE) and drive.state == "enabled"
