"""The radar interface turns radar frames into tracks."""

import pytest
from selfdrive.car.honda.radar_interface import RadarInterface
from selfdrive.sim.radar import RadarSensor
from selfdrive.sim.road import Road
from selfdrive.sim.truth import GroundTruth


@pytest.fixture
def radar():
    return RadarInterface()


def frames(d_rel=50.0, v_rel=-3.0, **truth):
    values = dict.fromkeys(GroundTruth._fields, 0.0) | {"d_rel": d_rel, "v_ego": 20.0, "v_lead": 20.0 + v_rel}
    return RadarSensor(Road(None, None)).measure(GroundTruth(**(values | truth)))


def test_a_track(radar):
    """A track has the radar's resolution of 1/16 m and 1/32 m/s, and left is positive."""
    data = radar.update(frames(d_rel=97.681, v_rel=-8.8902, lateral_offset=0.5), 1.0)
    (point,) = data.points
    assert (point.d_rel, point.v_rel, point.y_rel) == (97.625, -8.875, -0.5)
    assert data.t == 1.0 and data.errors == ()


def test_no_cycle_no_data(radar):
    """A step without the frame that ends a radar cycle returns None, before and after the first cycle."""
    assert radar.update([], 0.0) is None
    state, track = frames()
    assert radar.update([state], 0.05) is None
    assert radar.update([track], 0.05) is not None
    assert radar.update([], 0.06) is None


def test_track_ends_at_255_m(radar):
    """A distance of 255 m or more ends the track. A shorter distance afterwards starts a new track."""
    (first,) = radar.update(frames(d_rel=254.9), 0.0).points
    (same,) = radar.update(frames(d_rel=254.0), 0.05).points
    assert radar.update(frames(d_rel=255.0), 0.1).points == ()
    (other,) = radar.update(frames(d_rel=254.0), 0.15).points
    assert first.track_id == same.track_id != other.track_id


def test_fault_state(radar):
    state, track = frames()
    broken = state._replace(data=b"\x78" + state.data[1:])
    assert radar.update([broken, track], 0.0).errors == ("fault",)
    assert radar.update([state, track], 0.05).errors == ()


def test_missing_state_frames(radar):
    """Tracks without the state frame are a communication error after ten cycles."""
    state, track = frames()
    radar.update([state, track], 0.0)
    errors = [radar.update([track], 0.05 * cycle).errors for cycle in range(1, 13)]
    assert errors == [()] * 10 + [("comm_issue",)] * 2


def test_car_frames_are_not_the_radars(radar):
    assert radar.update([frame._replace(bus=0) for frame in frames()], 0.0) is None
