"""Learning the straight-ahead angle."""

import pytest
from selfdrive.common.conversions import DEG_TO_RAD
from selfdrive.controls.lib.angle_offset import AngleOffset


def learn(
    seconds: float, v_ego: float = 30.0, center: float = 0.5, prob: float = 1.0, angle: float = 0.0
) -> float:
    offset = AngleOffset()
    for _ in range(int(seconds * 20)):
        offset.update(v_ego, center, prob, angle)
    return offset.value / DEG_TO_RAD


def test_about_one_degree_is_learnt_in_two_minutes() -> None:
    """The car drives at 30 m/s, half a metre off the middle of the lane."""
    assert learn(120.0) == pytest.approx(0.967, abs=0.01)
    assert learn(120.0, center=-0.5) == pytest.approx(-0.967, abs=0.01)


def test_less_is_learnt_without_lines_at_low_speed_and_in_turns() -> None:
    assert learn(60.0, prob=0.0) == 0.0
    assert learn(60.0, v_ego=1.0) == 0.0
    assert learn(60.0, angle=5.0 * DEG_TO_RAD) == pytest.approx(learn(60.0) / 4.0)


def test_at_most_five_degrees_are_learnt() -> None:
    assert learn(3600.0) == pytest.approx(5.0)
