"""The world: two cars on a line, in steps of 0.1 s."""

from collections import namedtuple

from toycar.sensor import Sensor

Truth = namedtuple("Truth", "time gap speed lead_speed")


class World:
    def __init__(self):
        self.sensor = Sensor()
        self.step_count = 0
        self.gap = 50.0
        self.speed = 20.0

    def step(self):
        now = Truth(self.step_count / 10, self.gap, self.speed, 15.0)
        seen = self.sensor.measure(now)
        if seen:
            gap, rate = seen[0]
            self.speed += 0.01 * ((gap - 300) * 0.1 + rate)
        self.gap += (15.0 - self.speed) * 0.1
        self.step_count += 1
