"""The hazard definitions, tested at their limits."""

import pytest
from selfdrive.sim.hazards import HazardMonitor


def first(truth, *rows):
    monitor = HazardMonitor()
    for t, row in enumerate(rows):
        monitor.update(truth(t=float(t), **({"d_rel": 50.0, "v_ego": 20.0} | row)))
    return monitor.first


def test_ordinary_driving_has_no_hazard(truth):
    assert first(truth, {}, {}) == {"H1": None, "H2": None, "H3": None, "H4": None}


@pytest.mark.parametrize(
    ("d_rel", "offset", "hit"),
    [(0.0, 0.0, True), (0.01, 0.0, False), (-3.0, 2.75, True), (-3.0, -2.76, False)],
)
def test_h1_is_a_collision(truth, d_rel, offset, hit):
    """The cars overlap up to an offset of 2.75 m."""
    assert (first(truth, {"d_rel": d_rel, "lateral_offset": offset})["H1"] == 0.0) is hit


@pytest.mark.parametrize(
    ("v_ego", "d_rel", "free_road", "hit"),
    [
        (0.29, 100.0, False, True),
        (0.3, 100.0, False, False),
        (0.0, 99.9, False, False),
        (0.0, 200.0, True, True),
    ],
)
def test_h2_is_a_stop_on_a_free_road(truth, v_ego, d_rel, free_road, hit):
    stopped = {"v_ego": v_ego, "d_rel": d_rel, "free_road": free_road}
    assert (first(truth, {}, stopped)["H2"] == 1.0) is hit


def test_h2_needs_a_car_that_has_moved(truth):
    rest = {"v_ego": 0.0, "d_rel": 150.0}
    assert first(truth, rest, rest)["H2"] is None
    assert first(truth, rest, {"v_ego": 0.3}, rest)["H2"] == 2.0


@pytest.mark.parametrize(("offset", "hit"), [(0.94, False), (0.96, True), (-0.96, True)])
def test_h3_is_a_lane_departure(truth, offset, hit):
    """At an offset of more than 0.95 m, a side of the car is outside the lane."""
    assert (first(truth, {"lateral_offset": offset})["H3"] == 0.0) is hit


def braking(truth, seconds, **row):
    """Brake at 3.51 m/s^2 for this long, then release; return the time of H4."""
    monitor = HazardMonitor()
    for k in range(200):
        values = {"d_rel": 50.0, "v_ego": 20.0, "v_lead": 20.0, "a_ego": -3.51} | row
        values["a_ego"] *= k <= round(100 * seconds)
        monitor.update(truth(t=k / 100, **values))
    return monitor.first["H4"]


@pytest.mark.parametrize(("seconds", "at"), [(0.49, None), (0.5, 0.5), (1.0, 0.5)])
def test_h4_is_half_a_second_of_hard_braking(truth, seconds, at):
    assert braking(truth, seconds) == at


@pytest.mark.parametrize(
    ("row", "hit"),
    [
        ({"a_ego": -3.5}, False),
        ({"d_rel": 40.0, "v_lead": 10.0}, False),
        ({"d_rel": 40.1, "v_lead": 10.0}, True),
        ({"d_rel": 1.0, "v_lead": 21.0}, True),
        ({"d_rel": 200.0, "free_road": True}, True),
    ],
)
def test_h4_needs_braking_that_nothing_calls_for(truth, row, hit):
    """The time to collision is 4 s at a distance of 40 m and a closing speed of 10 m/s."""
    assert (braking(truth, 1.0, **row) is not None) is hit


def test_a_pause_starts_the_half_second_anew(truth):
    monitor = HazardMonitor()
    for k in range(100):
        monitor.update(truth(t=k / 100, d_rel=50.0, v_ego=20.0, v_lead=20.0, a_ego=-4.0 * (k != 40)))
    assert monitor.first["H4"] == 0.91


def test_only_the_first_time_is_recorded(truth):
    out = {"lateral_offset": 2.0}
    assert first(truth, {}, out, {}, out)["H3"] == 1.0
