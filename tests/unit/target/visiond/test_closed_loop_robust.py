"""The geometric detector keeps the lane in the five scenarios on rendered roads."""

from pathlib import Path

import numpy as np
import pytest
from selfdrive.sim.picture_options import ROBUST_DETECTOR, PictureOptions
from selfdrive.sim.run import simulate
from selfdrive.sim.scenario import load_scenario

SCENARIOS = Path(__file__).resolve().parents[4] / "fault_library" / "scenarios"


@pytest.mark.slow
@pytest.mark.parametrize("marks", ["solid", "dashed"])
@pytest.mark.parametrize("seed", [0, 2**40])
def test_the_lane_is_kept(marks, seed, tmp_path):
    for name in ("S1", "S2", "S3", "S4", "S5"):
        pictures = PictureOptions(detector=ROBUST_DETECTOR, marks=marks, cache=tmp_path)
        result = simulate(load_scenario(SCENARIOS / f"{name}.yaml"), seed, pictures)
        assert set(result.record["hazards"].values()) == {None}
        assert "steer_saturated" not in [alert["name"] for alert in result.record["alerts"]]
        assert np.abs(result.trace["lateral_offset"]).max() <= 0.3
