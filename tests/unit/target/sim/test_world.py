"""The lead vehicle, the road and what the camera sees of them."""

import pytest
from selfdrive.sim.camera import GeometryCamera
from selfdrive.sim.lead import LeadVehicle
from selfdrive.sim.road import Road
from selfdrive.visiond.detector import IdealDetector
from selfdrive.visiond.visiond import Visiond

STRAIGHT = Road(None, None)
BEND = Road(None, ((0.0,), (0.002,)))


def test_the_lead_follows_its_profile():
    lead = LeadVehicle(100.0, (0.0, 1.0, 2.0), (10.0, 10.0, 20.0))
    speeds = []
    for frame in range(300):
        lead.step(frame / 100)
        speeds.append(lead.speed)
    assert speeds[:101] == [10.0] * 101
    assert speeds[150] == pytest.approx(15.0)
    assert speeds[250] == 20.0
    assert lead.position == pytest.approx(100.0 + sum(speeds) / 100)


def test_grade_and_curvature_tables():
    road = Road(((0.0, 10.0, 11.0), (0.0, 0.0, 1.0)), ((100.0, 200.0), (0.0, 0.002)))
    assert [road.grade(t) for t in (5.0, 10.5, 20.0)] == [0.0, 0.5, 1.0]
    assert [road.curvature(s) for s in (0.0, 150.0, 300.0)] == [0.0, 0.001, 0.002]
    assert (STRAIGHT.grade(5.0), STRAIGHT.curvature(5.0), STRAIGHT.bend(5.0, 50)) == (0.0, 0.0, None)


def test_bend_is_a_parabola_for_constant_curvature():
    points = BEND.bend(0.0, 50)
    assert points == pytest.approx([0.001 * x * x for x in range(50)])
    assert BEND.sideways(0.0, 40.2) == points[40]
    assert STRAIGHT.sideways(0.0, 40.0) == 0.0


def test_lane_in_view(truth):
    view = GeometryCamera(STRAIGHT).look(truth(d_rel=42.0))
    assert (view.left_lane_y, view.right_lane_y, view.path_y, view.lead_d_rel) == (1.85, -1.85, 0.0, 42.0)
    assert view.bend == (0.0,) * 50
    view = GeometryCamera(STRAIGHT).look(truth(lateral_offset=0.4))
    assert (view.left_lane_y, view.right_lane_y, view.path_y) == pytest.approx((1.45, -2.25, -0.4))


def test_heading_and_bend_in_view(truth):
    assert GeometryCamera(STRAIGHT).look(truth(heading=0.1)).bend[49] == pytest.approx(
        -49 * 0.100335, rel=1e-4
    )
    assert GeometryCamera(BEND).look(truth()).bend[49] == pytest.approx(0.001 * 49**2)
    both = GeometryCamera(BEND).look(truth(heading=0.1)).bend
    assert both[49] == pytest.approx(0.001 * 49**2 - 49 * 0.100335, rel=1e-4)


def test_ideal_vision_publishes_the_true_geometry(truth):
    visiond = Visiond(IdealDetector())
    assert visiond.latest is None
    visiond.update(GeometryCamera(BEND).look(truth(lateral_offset=0.5, d_rel=33.0)), 7.0)
    model = visiond.latest
    bend = [0.001 * x * x for x in range(50)]
    assert model.t == 7.0
    assert model.left_lane.points == pytest.approx([1.35 + y for y in bend])
    assert model.right_lane.points == pytest.approx([-2.35 + y for y in bend])
    assert model.path.points == pytest.approx([-0.5 + y for y in bend])
    assert (model.lead.d_rel, model.lead.prob) == (33.0, 1.0)
