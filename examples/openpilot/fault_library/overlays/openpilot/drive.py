"""A drive in one of the loops `plant`, `lead` and `bend`; the scenario names it."""

from importlib import import_module
from math import nan

from mutator.glue import Run

CHANNELS = ("gap", "speed", "lead", "acceleration", "offset", "heading", "road")
CHANNELS += ("lead_seen", "lead_gap", "lead_speed", "target", "command", "desired", "measured", "torque")


class Drive(Run):
    def __init__(self, scenario, seed):
        loop = import_module(scenario["loop"]).Loop
        super().__init__(step_s=loop.STEP_S, duration_s=scenario["duration_s"])
        self.loop = loop(scenario)

    def step(self):
        truth = {"heading": 0.0, "lead": 0.0, "gap": 1000.0, "offset": 0.0, "road": 0.0} | self.loop.truth(
            self.t
        )
        channels = dict.fromkeys(CHANNELS, nan) | truth | self.loop.step(self.t)  # NaN: of other loops
        for name, now in self.loop.alerts.items():
            self.alert(name, now)
        self.record(**channels)


if __name__ == "__main__":
    Drive.main()
