"""Kalman filters. The speed estimate is compared with values measured on openpilot."""

import pytest
from selfdrive.car.honda.carstate import SPEED_KALMAN_GAINS
from selfdrive.common.kalman import DistanceFilter, SteadyKalman


def test_the_first_speed_estimates_agree_with_openpilot() -> None:
    """For a measured speed of 26.797 m/s, the third and fourth estimates equal openpilot's."""
    speed = SteadyKalman(0.0, 0.0, dt=0.01, gains=SPEED_KALMAN_GAINS)
    values = []
    for _ in range(4):
        speed.update(26.797)
        values.append(speed.value)
    assert values[2:] == pytest.approx([8.9334, 11.338], abs=1e-3)
    assert speed.rate == pytest.approx(26.314, abs=1e-2)


def test_distance_filter_learns_the_rate() -> None:
    lead = DistanceFilter(variance=1e2, q_distance=0.5, q_rate=1.0)
    lead.restart(80.0, 0.01, 1e2)
    for k in range(100):
        lead.update(80.0 - 0.5 * k, 0.01)
        lead.predict(0.05)
    assert lead.rate == pytest.approx(-10.0, abs=0.05)
    assert lead.value == pytest.approx(30.0, abs=0.1)


def test_distance_filter_restart_forgets_the_rate() -> None:
    lead = DistanceFilter(variance=1e2, q_distance=0.5, q_rate=1.0)
    lead.update(50.0, 1.0)
    lead.predict(0.05)
    lead.update(49.0, 1.0)
    lead.restart(30.0, 0.01, 1e2)
    assert (lead.value, lead.rate, lead.p01) == (30.0, 0.0, 0.0)
