"""The set speed agrees with measurements on openpilot."""

import pytest
from selfdrive.controls.lib.cruise_speed import button_v_cruise, initial_v_cruise
from selfdrive.messages import ButtonEvent


@pytest.mark.parametrize(
    ("v_ego", "expected"), [(26.878, 97), (2.9, 40), (9.7, 40), (29.97, 108), (20.0, 72), (50.0, 180)]
)
def test_engaging_sets_the_cars_speed_but_at_least_40_kmh(v_ego: float, expected: int) -> None:
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
def test_releasing_a_button_sets_a_multiple_of_8(button: str, before: int, after: int) -> None:
    """A decrease starts from the multiple of 8 at or below the speed."""
    assert button_v_cruise(before, [ButtonEvent(button, False)]) == after


def test_pressing_a_button_without_releasing_it_does_nothing() -> None:
    assert button_v_cruise(64, [ButtonEvent("accel", True)]) == 64
