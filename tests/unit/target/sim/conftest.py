"""Scenarios and truths to try parts of the simulator on."""

from pathlib import Path

import pytest
from selfdrive.sim.truth import GroundTruth


@pytest.fixture
def scenarios():
    return Path(__file__).parents[4] / "fault_library" / "scenarios"


@pytest.fixture
def truth():
    """Makes a ground truth: a car at rest in the middle of the lane, but for what is given."""

    def make(**values):
        return GroundTruth(**(dict.fromkeys(GroundTruth._fields, 0.0) | {"free_road": False} | values))

    return make
