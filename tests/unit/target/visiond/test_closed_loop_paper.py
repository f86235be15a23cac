"""The paper's detector keeps the lane in the five scenarios on rendered roads."""

from pathlib import Path

import numpy as np
import pytest
from selfdrive.sim.picture_options import PictureOptions
from selfdrive.sim.scenario import load_scenario
from selfdrive.sim.simulator import Simulator

SCENARIOS = Path(__file__).resolve().parents[4] / "fault_library" / "scenarios"


@pytest.fixture(scope="module")
def cache(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("pictures")


def drive(name: str, marks: str, cache: Path):
    simulator = Simulator()
    pictures = PictureOptions(detector="paper", marks=marks, cache=cache)
    simulator.reset(load_scenario(SCENARIOS / f"{name}.yaml"), 0, pictures)
    while not simulator.is_finished:
        simulator.step()
    return simulator.result()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["S1", "S2", "S3", "S4", "S5"])
def test_the_lane_is_kept_between_solid_lines(name, cache):
    result = drive(name, "solid", cache)
    assert set(result.record["hazards"].values()) == {None}
    assert "steer_saturated" not in [alert["name"] for alert in result.record["alerts"]]
    assert np.abs(result.trace["lateral_offset"]).max() <= 0.3


@pytest.mark.slow
def test_in_gaps_between_dashes_the_car_wanders_but_stays_in_its_lane(cache):
    result = drive("S3", "dashed", cache)
    assert result.record["hazards"]["H3"] is None
    assert np.abs(result.trace["lateral_offset"]).max() <= 0.5
