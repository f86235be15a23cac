"""Text and duration of each alert. The texts are ours; priorities and durations are the original's."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

LOWEST, LOW, MID, HIGH = range(4)  # priorities; the highest is shown


class Alert(NamedTuple):
    """An alert's text, appearance and sound; durations in s since it was last raised."""

    text1: str
    text2: str
    priority: int
    visual: str
    audible: str
    sound_s: float
    visual_s: float
    text_s: float

    @property
    def ends(self) -> tuple[float, float, float]:
        return self.sound_s, self.visual_s, self.text_s

    @property
    def duration(self) -> float:
        return max(self.ends)


_SPECIAL = {
    "startup": Alert("Hands on the wheel", "Be ready to take over", LOWEST, "none", "none", 0.0, 0.0, 15.0),
    "enable": Alert("", "", MID, "none", "beep_single", 0.2, 0.0, 0.0),
    "disable": Alert("", "", MID, "none", "beep_single", 0.2, 0.0, 0.0),
    "fcw": Alert("Brake now", "Collision ahead", HIGH, "fcw", "chime_repeated", 1.0, 2.0, 2.0),
    "steer_saturated": Alert(
        "Take over steering", "Turn is too sharp", LOW, "steer_required", "chime_single", 1.0, 2.0, 3.0
    ),
    "steer_temp_unavailable": Alert(
        "Take over steering", "Power steering is busy", LOW, "steer_required", "chime_double", 0.4, 2.0, 3.0
    ),
    "pre_driver_distracted": Alert(
        "Touch the wheel", "Driver seems absent", LOW, "steer_required", "chime_double", 0.1, 0.1, 0.1
    ),
    "driver_distracted": Alert(
        "Touch the wheel", "Slowing down", MID, "steer_required", "chime_repeated", 0.1, 0.1, 0.1
    ),
}

# The problem that each event reports.
_IMMEDIATE = {
    "can_error": "CAN messages are missing",
    "radar_error": "No data from the radar",
    "model_error": "No data from the camera",
    "steer_unavailable": "Power steering fault",
    "brake_unavailable": "Brake fault",
    "reverse_gear": "Reverse gear",
}
_SOFT = {
    "wrong_gear": "Gear is not D",
    "door_open": "A door is open",
    "seatbelt_not_latched": "Seat belt is open",
    "esp_disabled": "Stability control is off",
}
_QUIET = {"no_target": "No lead vehicle nearby"}
_NO_ENTRY_ONLY = {
    "wrong_car_mode": "Main switch is off",
    "pedal_pressed": "A pedal is pressed",
    "brake_hold": "Brake hold is active",
    "park_brake": "Parking brake is on",
    "steer_temp_unavailable": "Power steering is busy",
}
_PERMANENT = ("steer_unavailable", "brake_unavailable")


def _table() -> dict[str, Alert]:
    table = dict(_SPECIAL)
    for name, text in _IMMEDIATE.items():
        table[name] = Alert("Take over now", text, HIGH, "steer_required", "chime_repeated", 1.0, 3.0, 4.0)
    for name, text in _SOFT.items():
        table[name] = Alert("Take over now", text, MID, "steer_required", "chime_repeated", 1.0, 3.0, 3.0)
    for name, text in _QUIET.items():
        table[name] = Alert("Disengaged", text, HIGH, "none", "chime_double", 0.4, 2.0, 3.0)
    for name, text in (_IMMEDIATE | _SOFT | _QUIET | _NO_ENTRY_ONLY).items():
        visual = "brake_pressed" if name == "pedal_pressed" else "none"
        table[name + "_no_entry"] = Alert("Cannot engage", text, LOW, visual, "chime_double", 0.4, 2.0, 3.0)
    for name in _PERMANENT:
        table[name + "_permanent"] = Alert(_IMMEDIATE[name], "", LOWEST, "none", "none", 0.0, 0.0, 0.2)
    return table


ALERTS: Mapping[str, Alert] = MappingProxyType(_table())
