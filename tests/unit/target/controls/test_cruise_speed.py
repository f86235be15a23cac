"""The set speed agrees with measurements on the original."""

import pytest
from selfdrive.controls.lib.cruise_speed import button_v_cruise, initial_v_cruise
from selfdrive.messages import ButtonEvent


@pytest.mark.parametrize(
    ("v_ego", "expected"), [(26.878, 97), (2.9, 40), (9.7, 40), (29.97, 108), (20.0, 72), (50.0, 180)]
)
def test_engaging_takes_the_speed_but_at_least_40(v_ego: float, expected: int) -> None:
    """Engaging sets the car's speed in whole km/h, but at least 40."""
    assert initial_v_cruise(v_ego) == expected


@pytest.mark.parametrize(
    ("button", "before", "after"),
    [
        ("accel", 63, 64),
        ("accel", 64, 72),
        ("accel", 108, 112),
        ("accel", 144, 144),
        ("decel", 95, 80),
        ("decel", 80, 72),
        ("decel", 8, 8),
        ("cancel", 64, 64),
    ],
)
def test_released_button_moves_to_a_multiple_of_8(button: str, before: int, after: int) -> None:
    """RES goes to the next multiple of 8, SET to the one before the last, within 8..144."""
    assert button_v_cruise(before, [ButtonEvent(button, False)]) == after


def test_pressing_alone_does_nothing() -> None:
    assert button_v_cruise(64, [ButtonEvent("accel", True)]) == 64
