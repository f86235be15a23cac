"""Scenarios and truths for tests of parts of the simulator."""

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
    return cache(lambda name: simulate(load_scenario(SCENARIOS / f"{name}.yaml"), 0))


@pytest.fixture
def truth():
    def make(**values):
        return GroundTruth(**(dict.fromkeys(GroundTruth._fields, 0.0) | {"free_road": False} | values))

    return make
