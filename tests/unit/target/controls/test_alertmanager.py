"""Priorities and durations of alerts."""

import pytest
from selfdrive.car.honda import interface
from selfdrive.controls import controlsd, plannerd
from selfdrive.controls.lib.alertmanager import AlertManager
from selfdrive.controls.lib.alerts import ALERTS, HIGH, LOW, LOWEST, MID
from selfdrive.controls.lib.events import (
    IMMEDIATE_DISABLE,
    NO_ENTRY,
    PERMANENT,
    SOFT_DISABLE,
    WARNING,
    Event,
)


def test_the_engage_alert_interrupts_the_startup_text() -> None:
    """As in openpilot, the start-up text is shown for 15 s, except for 0.2 s after engaging at 1.31 s."""
    alerts = AlertManager()
    alerts.add("startup", 0.12)
    shown = {}
    for k in range(12, 1520):
        t = k * 0.01
        if k == 131:
            alerts.add("enable", t)
        alerts.process(t)
        shown[k] = alerts.text1 != ""
    assert shown[130] and not shown[131] and not shown[150] and shown[152]
    assert shown[1511] and not shown[1513]


def test_the_highest_priority_is_shown_and_all_alerts_are_listed() -> None:
    alerts = AlertManager()
    alerts.add("steer_saturated", 1.0)
    alerts.add("fcw", 1.0)
    alerts.process(1.0)
    assert alerts.active == ("fcw", "steer_saturated")
    assert (alerts.visual, alerts.audible) == ("fcw", "chime_repeated")
    alerts.process(3.0)
    assert alerts.active == ("steer_saturated",)


def test_the_newer_of_two_alerts_with_equal_priority_is_shown() -> None:
    alerts = AlertManager()
    alerts.add("can_error_no_entry", 1.0)
    alerts.add("steer_saturated", 1.5)
    alerts.process(1.5)
    assert alerts.active == ("steer_saturated", "can_error_no_entry")
    alerts.add("can_error_no_entry", 2.0)
    alerts.process(2.0)
    assert alerts.text2 == ALERTS["can_error_no_entry"].text2


def test_sound_picture_and_text_end_one_after_the_other() -> None:
    alerts = AlertManager()
    alerts.add("steer_saturated", 0.0)
    alerts.process(0.5)
    assert alerts.audible == "chime_single"
    alerts.process(1.5)
    assert (alerts.audible, alerts.visual) == ("none", "steer_required")
    alerts.process(2.5)
    assert (alerts.visual, alerts.text1) == ("none", ALERTS["steer_saturated"].text1)
    alerts.process(3.0)
    assert (alerts.active, alerts.text1) == ((), "")


def test_an_alert_raised_again_lasts_its_full_duration() -> None:
    alerts = AlertManager()
    for k in range(100):
        alerts.add("steer_saturated", k * 0.01)
        alerts.process(k * 0.01)
    alerts.process(3.5)
    assert alerts.active == ("steer_saturated",)


def test_an_unknown_alert_is_an_error() -> None:
    with pytest.raises(KeyError, match="no alert is named 'nonsense'"):
        AlertManager().add("nonsense", 0.0)


EVENTS = [
    *(event for _, event in interface._EVENT_OF_CONDITION),
    *(
        e
        for module in (interface, controlsd, plannerd)
        for e in vars(module).values()
        if isinstance(e, Event)
    ),
]
SUFFIX = {
    NO_ENTRY: "_no_entry",
    PERMANENT: "_permanent",
    WARNING: "",
    SOFT_DISABLE: "",
    IMMEDIATE_DISABLE: "",
}


@pytest.mark.parametrize("event", EVENTS, ids=lambda event: event.name)
def test_every_event_has_an_alert_for_each_of_its_kinds(event: Event) -> None:
    asked = {event.name + SUFFIX[kind] for kind in event.kinds if kind in SUFFIX}
    assert asked <= set(ALERTS)


def test_every_alert_can_be_raised() -> None:
    asked = {event.name + SUFFIX[kind] for event in EVENTS for kind in event.kinds if kind in SUFFIX}
    in_the_loop = {"startup", "enable", "disable", "fcw", "steer_saturated"}
    assert set(ALERTS) - asked - in_the_loop == {"pre_driver_distracted", "driver_distracted"}


@pytest.mark.parametrize(
    ("name", "priority", "duration"),
    [
        ("startup", LOWEST, 15.0),
        ("enable", MID, 0.2),
        ("fcw", HIGH, 2.0),
        ("steer_saturated", LOW, 3.0),
        ("can_error", HIGH, 4.0),
        ("radar_error", HIGH, 4.0),
        ("model_error", HIGH, 4.0),
        ("wrong_gear", MID, 3.0),
        ("can_error_no_entry", LOW, 3.0),
        ("steer_unavailable_permanent", LOWEST, 0.2),
        ("driver_distracted", MID, 0.1),
    ],
)
def test_priority_and_duration_of_alerts(name: str, priority: int, duration: float) -> None:
    assert (ALERTS[name].priority, ALERTS[name].duration) == (priority, duration)


@pytest.mark.parametrize(
    ("name", "ends"),
    [
        ("can_error", (1.0, 3.0, 4.0)),
        ("wrong_gear", (1.0, 3.0, 3.0)),
        ("no_target", (0.4, 2.0, 3.0)),
        ("can_error_no_entry", (0.4, 2.0, 3.0)),
        ("fcw", (1.0, 2.0, 2.0)),
        ("steer_saturated", (1.0, 2.0, 3.0)),
    ],
)
def test_ends_of_sound_picture_and_text(name: str, ends: tuple[float, float, float]) -> None:
    assert ALERTS[name].ends == ends
