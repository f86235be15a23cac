"""Radar tracks and clusters of tracks."""

import pytest
from selfdrive.controls.lib.radar_helpers import Cluster, Track, cluster_tracks


def track(
    d_rel: float = 50.0, y_rel: float = 0.0, v_rel: float = 0.0, d_path: float = 0.0, v_ego: float = 20.0
):
    return Track(d_rel, y_rel, v_rel, d_path, v_ego)


def step(
    t: Track, v_rel: float, v_ego: float = 20.0, d_path: float = 0.0, driver_steers: bool = False
) -> None:
    t.update(50.0, 0.0, v_rel, d_path, v_ego, driver_steers)


@pytest.mark.parametrize(
    ("v_rel", "v_ego", "stationary"),
    [(-20.0, 20.0, True), (-16.1, 20.0, True), (-15.9, 20.0, False), (-3.9, 3.9, False), (-23.9, 20.0, True)],
)
def test_an_object_below_4_mps_is_stationary_while_the_car_is_faster(
    v_rel: float, v_ego: float, stationary: bool
) -> None:
    assert track(v_rel=v_rel, v_ego=v_ego).stationary is stationary


def test_an_object_that_has_moved_is_never_stationary_again() -> None:
    t = track(v_rel=0.0)
    step(t, -20.0)
    assert not t.stationary


def test_a_stationary_object_can_start_moving() -> None:
    t = track(v_rel=-20.0)
    step(t, -15.0)
    assert not t.stationary


def test_an_object_can_stop_being_oncoming() -> None:
    t = track(v_rel=-24.0)
    assert t.oncoming
    step(t, -23.0)
    assert not t.oncoming


def test_an_object_fused_three_times_is_no_longer_stationary() -> None:
    t = track(v_rel=-20.0)
    t.fuse()
    t.fuse()
    assert t.stationary
    t.fuse()
    assert not t.stationary


def test_lead_speed_and_acceleration_follow_the_measurement() -> None:
    t = track(v_rel=0.0)
    for k in range(1, 61):
        step(t, -0.1 * k)
    assert t.filter.rate == pytest.approx(-2.0, abs=0.05)
    assert t.filter.value == pytest.approx(14.0, abs=0.7)
    assert t.a_rel == pytest.approx(-2.0, abs=0.01)


def test_relative_acceleration_is_limited() -> None:
    t = track(v_rel=0.0)
    step(t, -5.0)
    assert t.a_rel == pytest.approx(-10.0 * 0.1358, abs=0.01)


def test_lateral_speed_is_not_estimated_while_the_driver_steers() -> None:
    """An object moving towards the path has lateral speed, unless the driver's steering moves the path."""
    free, steered = track(d_path=3.0), track(d_path=3.0)
    for k in range(1, 21):
        step(free, 0.0, d_path=3.0 - 0.05 * k)
        step(steered, 0.0, d_path=3.0 - 0.05 * k, driver_steers=True)
    assert free.v_lat == pytest.approx(-0.69, abs=0.05)
    assert steered.v_lat == 0.0


def lead(d_rel: float = 50.0, d_path: float = 0.0, v_lat: float = 0.0, v_rel: float = 0.0) -> Cluster:
    t = track(d_rel=d_rel, d_path=d_path, v_rel=v_rel)
    t.v_lat = v_lat
    return Cluster([t])


@pytest.mark.parametrize(
    ("cluster", "expected"),
    [
        (lead(d_path=1.4), True),
        (lead(d_path=-1.6), False),
        (lead(v_rel=-20.0), False),
        (lead(v_rel=-30.0), False),
        (lead(d_rel=10.0, d_path=2.0, v_lat=-0.6), True),  # cuts in
        (lead(d_rel=57.0, d_path=2.0, v_lat=-99.0), False),  # too far away, so the lateral speed is ignored
        (lead(d_rel=56.0, d_path=2.0, v_lat=-99.0), True),
        (lead(d_rel=10.0, d_path=2.6, v_lat=-5.0), False),  # the correction is limited to 1 m
        (lead(d_rel=10.0, d_path=1.4, v_lat=5.0), True),  # a speed away from the path is ignored
    ],
)
def test_lead_is_on_the_path_or_cuts_in(cluster: Cluster, expected: bool) -> None:
    assert cluster.is_lead(20.0) is expected


@pytest.mark.parametrize("v_rel", [-20.0, -30.0])
def test_one_moving_track_makes_a_cluster_a_lead(v_rel: float) -> None:
    assert not Cluster([track(v_rel=v_rel), track(v_rel=v_rel)]).is_lead(20.0)
    assert Cluster([track(v_rel=v_rel), track()]).is_lead(20.0)


def test_the_second_lead_must_be_apart_from_the_first() -> None:
    first = lead(d_rel=40.0)
    assert not lead(d_rel=48.0).is_apart(first)
    assert lead(d_rel=48.1).is_apart(first)
    assert lead(d_rel=41.0, v_rel=1.1).is_apart(first)


def test_tracks_are_clustered_by_distance_lateral_position_and_speed() -> None:
    """Lateral distance is doubled, and a speed difference is treated as a distance."""
    tracks = [
        track(d_rel=40.0),
        track(d_rel=42.0),
        track(d_rel=40.0, y_rel=2.0),
        track(d_rel=41.0, v_rel=4.0),
    ]
    clusters = cluster_tracks(tracks)
    assert sorted(c.d_rel for c in clusters) == [40.0, 41.0, 41.0]


@pytest.mark.parametrize(("gap", "vehicles"), [(2.4, 1), (2.6, 2)])
def test_tracks_within_two_and_a_half_metres_are_one_cluster(gap: float, vehicles: int) -> None:
    assert len(cluster_tracks([track(d_rel=40.0), track(d_rel=40.0 + gap)])) == vehicles


def test_a_long_chain_of_tracks_is_split() -> None:
    """Distances are measured to the centre of the merged tracks."""
    clusters = cluster_tracks([track(d_rel=d) for d in (40.0, 42.0, 44.0, 46.0)])
    assert sorted(c.d_rel for c in clusters) == [41.0, 45.0]


def test_no_tracks_give_no_clusters() -> None:
    assert cluster_tracks([]) == []


def test_lead_data_has_the_means_of_the_tracks() -> None:
    near, far = track(d_rel=40.0, v_rel=-1.0), track(d_rel=42.0, v_rel=-2.0)
    for _ in range(20):
        far.fuse()
    data = Cluster([near, far]).lead_data(2.7)
    assert (data.status, data.d_rel, data.v_rel) == (True, pytest.approx(38.3), -1.5)
    assert (data.v_lead, data.v_lead_k, data.fcw) == (18.5, 18.5, True)
    near.fuse()
    assert not Cluster([near]).lead_data(2.7).fcw
