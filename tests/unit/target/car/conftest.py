"""A car with scripted sensors."""

import pytest
from selfdrive.sim.sensors import CarSensors
from selfdrive.sim.truth import GroundTruth


class Bench:
    """Builds the frames a Civic would send, step by step."""

    def __init__(self):
        self.sensors = CarSensors()
        self.frame = 0

    def frames(self, button=0, **truth):
        values = dict.fromkeys(GroundTruth._fields, 0.0) | truth
        frames = self.sensors.measure(GroundTruth(**values), button, self.frame)
        self.frame += 1
        return frames

    @property
    def t(self):
        return (self.frame - 1) / 100


@pytest.fixture
def bench():
    return Bench()
