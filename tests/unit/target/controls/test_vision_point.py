"""Matching of the camera's lead with radar tracks."""

import numpy as np
import pytest
from selfdrive.controls.lib.polynomial import ZERO
from selfdrive.controls.lib.radar_helpers import Track
from selfdrive.controls.lib.vision_point import VisionPoint
from selfdrive.messages import LeadVision


def seen(d_rel: float = 50.0, prob: float = 1.0, cycles: int = 40) -> VisionPoint:
    point = VisionPoint()
    for _ in range(cycles):
        point.update(LeadVision(d_rel, prob, 0.1))
    return point


def track(d_rel: float = 50.0, y_rel: float = 0.0, v_rel: float = 0.0) -> Track:
    return Track(d_rel, y_rel, v_rel, 0.0, 20.0)


@pytest.mark.parametrize(
    ("other", "matches"),
    [
        (track(d_rel=57.9), True),
        (track(d_rel=58.1), False),
        (track(y_rel=1.99), True),
        (track(y_rel=2.01), False),
        (track(v_rel=9.9), True),
        (track(v_rel=10.1), False),
    ],
)
def test_a_track_must_match_in_place_and_speed(other: Track, matches: bool) -> None:
    assert (seen().best_match([other], ZERO) is other) is matches


def test_the_track_closest_in_place_and_speed_matches() -> None:
    tracks = [track(d_rel=52.0), track(d_rel=51.0), track(d_rel=50.0, v_rel=3.0)]
    assert seen().best_match(tracks, ZERO) is tracks[1]


def test_the_cameras_lead_is_assumed_to_be_on_the_path() -> None:
    bend = (0.0, 0.001, 0.0, 0.0)
    off, on = track(y_rel=0.0), track(y_rel=2.5)
    assert seen().best_match([off, on], bend) is on


def test_the_filter_is_a_kalman_filter_with_the_cameras_variance() -> None:
    """Distance and speed are those of a Kalman filter with R = std^2 and, per cycle, Q = diag(0.5, 1)."""
    point, std = VisionPoint(), 3.0
    a, x, p = np.array([[1.0, 0.05], [0.0, 1.0]]), np.zeros(2), 1e2 * np.eye(2)
    for k in range(30):
        z = 50.0 - 0.4 * k
        point.update(LeadVision(z, 0.9, std))
        gain = p[:, 0] / (p[0, 0] + std**2)
        x = x + gain * (z - x[0])
        p = p - np.outer(gain, p[0])
        x, p = a @ x, a @ p @ a.T + np.diag([0.5, 1.0])
    assert (point._filter.value, point._filter.rate) == pytest.approx(tuple(x))


def test_an_uncertain_lead_matches_no_track() -> None:
    assert seen(prob=0.7).best_match([track()], ZERO) is None
    assert seen(prob=0.71).best_match([track()], ZERO) is not None


def test_the_filter_restarts_when_the_lead_becomes_certain() -> None:
    point = seen(d_rel=80.0)
    point.update(LeadVision(30.0, 0.5, 0.1))
    point.update(LeadVision(30.0, 0.9, 0.1))
    assert point.best_match([track(d_rel=30.0)], ZERO) is not None
