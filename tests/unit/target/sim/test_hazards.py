"""The hazard definitions, tested at their limits."""

import pytest
from selfdrive.sim.hazards import HazardMonitor


def first(truth, *rows):
    monitor = HazardMonitor()
    for t, row in enumerate(rows):
        monitor.update(truth(t=float(t), **({"d_rel": 50.0, "v_ego": 20.0} | row)))
    return monitor.first


def test_ordinary_driving_has_no_hazard(truth):
    assert first(truth, {}, {}) == {"H1": None, "H2": None, "H3": None}


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


def test_only_the_first_time_is_recorded(truth):
    out = {"lateral_offset": 2.0}
    assert first(truth, {}, out, {}, out)["H3"] == 1.0
