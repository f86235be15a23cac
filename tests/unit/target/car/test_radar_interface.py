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


def test_a_track_has_the_radars_resolution(radar):
    """Distances are multiples of 1/16 m, and speeds of 1/32 m/s. Positions to the left are positive."""
    data = radar.update(frames(d_rel=97.681, v_rel=-8.8902, lateral_offset=0.5), 1.0)
    (point,) = data.points
    assert (point.d_rel, point.v_rel, point.y_rel) == (97.625, -8.875, -0.5)
    assert data.t == 1.0 and data.errors == ()


def test_an_incomplete_radar_cycle_gives_no_data(radar):
    assert radar.update([], 0.0) is None
    state, track = frames()
    assert radar.update([state], 0.05) is None
    assert radar.update([track], 0.05) is not None
    assert radar.update([], 0.06) is None


def test_a_track_ends_at_255_m(radar):
    (first,) = radar.update(frames(d_rel=254.9), 0.0).points
    (same,) = radar.update(frames(d_rel=254.0), 0.05).points
    assert radar.update(frames(d_rel=255.0), 0.1).points == ()
    (other,) = radar.update(frames(d_rel=254.0), 0.15).points
    assert first.track_id == same.track_id != other.track_id


def test_a_fault_in_the_state_frame_is_reported(radar):
    state, track = frames()
    broken = state._replace(data=b"\x78" + state.data[1:])
    assert radar.update([broken, track], 0.0).errors == ("fault",)
    assert radar.update([state, track], 0.05).errors == ()


def test_tracks_without_a_state_frame_are_an_error_after_ten_cycles(radar):
    state, track = frames()
    radar.update([state, track], 0.0)
    errors = [radar.update([track], 0.05 * cycle).errors for cycle in range(1, 13)]
    assert errors == [()] * 10 + [("comm_issue",)] * 2


def test_frames_of_the_car_bus_are_ignored(radar):
    assert radar.update([frame._replace(bus=0) for frame in frames()], 0.0) is None
