"""Forward collision warning (FCW) and its counters."""

from dataclasses import replace

import pytest
from selfdrive.controls.lib.fcw import FcwChecker, time_to_collision
from selfdrive.messages import CarState, LeadData

CAR = CarState(v_ego=20.0, a_ego=0.0)
LEAD = LeadData(status=True, d_rel=20.0, v_rel=-10.0, v_lead=10.0, v_lead_k=10.0, fcw=True)
BRAKING = (0.0, -1.0, -2.0, -3.1, -3.1, -3.1, -3.1, -3.1, -3.1, -1.0, *(0.0,) * 11)


def warnings(
    car: CarState = CAR, lead: LeadData = LEAD, a_plan: tuple[float, ...] = BRAKING, cycles: int = 80
) -> list[float]:
    checker = FcwChecker()
    return [k * 0.05 for k in range(cycles) if checker.update(k * 0.05, car, lead, a_plan)]


def test_time_to_collision() -> None:
    """The gap divided by the closing speed, less if the lead brakes, and at most 5 s."""
    assert time_to_collision(20.0, 0.0, LEAD) == pytest.approx(2.0)
    assert time_to_collision(20.0, 0.0, replace(LEAD, a_lead_k=-2.0)) == pytest.approx(1.7082, abs=1e-3)
    assert time_to_collision(5.0, 0.0, LEAD) == 5.0


def test_the_assumed_braking_of_a_slow_lead_is_limited() -> None:
    """A lead is assumed to need at least 2 s to stop, so at 1 m/s it brakes at no more than 0.5 m/s^2."""
    slow = replace(LEAD, v_lead=1.0)
    assert time_to_collision(10.0, 0.0, replace(slow, a_lead_k=-9.0)) == pytest.approx(
        time_to_collision(10.0, 0.0, replace(slow, a_lead_k=-0.5))
    )


def test_a_warning_is_given_when_all_counters_are_full() -> None:
    assert warnings() == [pytest.approx(3.0)]


# Situations that each violate exactly one condition, with the smallest change that satisfies it.
BARELY = [
    ({"v_ego": 5.0}, {"v_lead": 3.0, "d_rel": 4.0}, {"v_ego": 5.01}, {}),
    ({"v_ego": 18.0}, {}, {"v_ego": 18.01}, {}),  # 2.5 s to collision
    ({"v_ego": 10.0}, {"d_rel": 1.0, "a_lead_k": -4.0}, {"v_ego": 10.01}, {}),  # not closing in
    ({}, {"v_lead": 2.5}, {}, {"v_lead": 2.51}),
    ({}, {"y_rel": -1.0}, {}, {"y_rel": -0.99}),
    ({}, {"v_lat": 0.4}, {}, {"v_lat": 0.39}),
    ({"left_blinker": True}, {}, {"left_blinker": False}, {}),
    ({"right_blinker": True}, {}, {"right_blinker": False}, {}),
    ({}, {"fcw": False}, {}, {"fcw": True}),
]


@pytest.mark.parametrize(("car", "lead", "car_change", "lead_change"), BARELY)
def test_each_condition_prevents_the_warning(
    car: dict, lead: dict, car_change: dict, lead_change: dict
) -> None:
    assert warnings(replace(CAR, **car), replace(LEAD, **lead)) == []
    car, lead = car | car_change, lead | lead_change
    assert warnings(replace(CAR, **car), replace(LEAD, **lead)) == [pytest.approx(3.0, abs=0.06)]


@pytest.mark.parametrize(("car", "lead", "car_change", "lead_change"), BARELY[:6])
def test_a_condition_must_hold_for_ten_cycles(
    car: dict, lead: dict, car_change: dict, lead_change: dict
) -> None:
    checker = FcwChecker()
    car, lead = replace(CAR, **car), replace(LEAD, **lead)
    for k in range(80):
        assert not checker.update(k * 0.05, car, lead, BRAKING)
    car, lead = replace(car, **car_change), replace(lead, **lead_change)
    warned = [checker.update(4.0 + k * 0.05, car, lead, BRAKING) for k in range(10)]
    assert warned == [False] * 9 + [True]


@pytest.mark.parametrize(
    ("a_plan", "a_ego", "expected"),
    [
        ((-2.0,) * 21, 0.0, 0),  # the threshold at 10 m/s is -2.67
        ((-2.7,) * 21, 0.0, 1),
        ((-2.7,) * 21, -0.5, 0),  # the car's current braking is subtracted
        ((-3.1,) + (0.0,) * 20, 0.0, 0),  # the first node is ignored
        ((0.0, -2.7) + (0.0,) * 19, 0.0, 1),
        ((0.0,) * 14 + (-2.7,) * 7, 0.0, 1),  # at 6.4 s
        ((0.0,) * 15 + (-2.9,) * 6, 0.0, 0),  # late
        ((0.0,) * 19 + (-3.1,) * 2, 0.0, 1),  # late but hard, at 9.4 s
        ((0.0,) * 20 + (-3.1,), 0.0, 0),  # the last node is ignored
    ],
)
def test_a_warning_needs_a_plan_that_brakes_hard(
    a_plan: tuple[float, ...], a_ego: float, expected: int
) -> None:
    assert len(warnings(replace(CAR, a_ego=a_ego), a_plan=a_plan)) == expected


def test_a_lead_must_be_detected_for_31_cycles() -> None:
    checker = FcwChecker()
    checker._no_blinker = 10.0
    warned = [checker.update(k * 0.05, CAR, LEAD, BRAKING) for k in range(31)]
    assert warned == [False] * 30 + [True]


def test_a_lead_that_stopped_before_the_camera_saw_it_causes_a_warning() -> None:
    """The highest speed of the lead is kept from the radar's first detection.

    The other counters start when the camera sees the lead.
    """
    checker = FcwChecker()
    checker.update(0.0, CAR, replace(LEAD, v_lead=9.0, fcw=False), BRAKING)
    standing = replace(LEAD, v_lead=0.0, d_rel=30.0)
    assert [k for k in range(80) if checker.update(k * 0.05, CAR, standing, BRAKING)] == [60]


def test_warnings_are_at_least_five_seconds_apart() -> None:
    times = warnings(cycles=300)
    assert len(times) == 3 and times[1] - times[0] == pytest.approx(5.05)


def test_a_new_lead_restarts_the_counters() -> None:
    checker = FcwChecker()
    for k in range(59):
        assert not checker.update(k * 0.05, CAR, LEAD, BRAKING)
    checker.reset()
    assert not checker.update(2.95, CAR, LEAD, BRAKING)
