"""The set speed, in whole km/h as displayed."""

from collections.abc import Iterable

from selfdrive.common.conversions import MS_TO_KPH
from selfdrive.messages import ButtonEvent

V_CRUISE_MIN = 8  # km/h
V_CRUISE_MAX = 144  # km/h
V_CRUISE_DELTA = 8  # km/h
V_CRUISE_ENABLE_MIN = 40  # km/h
V_CRUISE_NONE = 255  # km/h, before the first engagement


def initial_v_cruise(v_ego: float) -> int:
    """Set speed (km/h) when the driver engages at `v_ego` (m/s)."""
    return int(max(v_ego * MS_TO_KPH, V_CRUISE_ENABLE_MIN) + 0.5)


def button_v_cruise(v_cruise: int, buttons: Iterable[ButtonEvent]) -> int:
    """Return the set speed (km/h) after the buttons released in this cycle while engaged.

    As in the original, both buttons start from the multiple of 8 at or below the set speed, so a first
    `decel` from 95 gives 80.
    """
    for button in buttons:
        if button.pressed:
            continue
        floor = v_cruise - v_cruise % V_CRUISE_DELTA
        if button.type == "accel":
            v_cruise = floor + V_CRUISE_DELTA
        elif button.type == "decel":
            v_cruise = floor - V_CRUISE_DELTA
        v_cruise = max(V_CRUISE_MIN, min(V_CRUISE_MAX, v_cruise))
    return v_cruise
