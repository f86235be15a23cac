"""Scenarios and truths to try parts of the simulator on."""

from functools import cache
from pathlib import Path

import pytest
from selfdrive.sim.run import simulate
from selfdrive.sim.scenario import load_scenario
from selfdrive.sim.truth import GroundTruth

SCENARIOS = Path(__file__).parents[4] / "fault_library" / "scenarios"


@pytest.fixture
def scenarios():
    return SCENARIOS


@pytest.fixture(scope="session")
def fault_free():
    """Runs a scenario of the library without a fault, once; returns its result."""
    return cache(lambda name: simulate(load_scenario(SCENARIOS / f"{name}.yaml"), 0))


@pytest.fixture
def truth():
    """Makes a ground truth: a car at rest in the middle of the lane, but for what is given."""

    def make(**values):
        return GroundTruth(**(dict.fromkeys(GroundTruth._fields, 0.0) | {"free_road": False} | values))

    return make
