"""Limits of cruise control."""

import pytest
from selfdrive.controls.lib import cruise_plan
from selfdrive.controls.lib.cruise_plan import cruise_limits, is_following
from selfdrive.messages import LeadData


@pytest.mark.parametrize(
    ("v_ego", "following", "a_min", "a_max"),
    [
        (0.0, False, -1.0, 1.0),
        (5.0, False, -0.8, 1.0),
        (20.0, False, -0.5, 0.5),
        (30.0, False, -0.4, 0.4),
        (0.0, True, -1.0, 1.5),
        (10.0, True, -0.67, 1.2),
        (40.0, True, -0.3, 0.3),
    ],
)
def test_acceleration_limits_depend_on_speed(
    v_ego: float, following: bool, a_min: float, a_max: float
) -> None:
    limits = cruise_limits(v_ego, following, 0.0, slow_down=False)
    assert limits == pytest.approx((a_min, a_max, a_min, a_max))


def test_the_jerk_limit_is_at_least_0_1(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cruise_plan, "A_MIN", (-0.01,) * 5)
    monkeypatch.setattr(cruise_plan, "A_MAX", (0.01,) * 5)
    assert cruise_limits(20.0, False, 0.0, slow_down=False) == (-0.01, 0.01, -0.1, 0.1)


def test_turns_lower_the_acceleration_limit() -> None:
    """At 20 m/s, lateral and longitudinal acceleration share 1.9 m/s^2."""
    limits = cruise_limits(20.0, False, 1.88, slow_down=False)
    assert limits.a_max == pytest.approx((1.9**2 - 1.88**2) ** 0.5)
    assert limits.j_max == pytest.approx(0.5)
    assert cruise_limits(20.0, False, 5.0, slow_down=False).a_max == 0.0


def test_an_absent_driver_slows_the_car() -> None:
    assert cruise_limits(20.0, True, 0.0, slow_down=True)[:2] == (-0.5, -0.2)


LEAD = {"status": True, "d_rel": 40.0, "v_lead_k": 21.0, "a_lead_k": 0.1}


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, True),
        ({"status": False}, False),
        ({"d_rel": 45.0}, False),
        ({"v_lead_k": 20.0}, False),
        ({"a_lead_k": 0.0}, False),
    ],
)
def test_following_needs_a_near_faster_and_accelerating_lead(change: dict, expected: bool) -> None:
    assert is_following(20.0, LeadData(**(LEAD | change))) is expected
