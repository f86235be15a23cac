"""The first loop: openpilot's own maneuver plant, which drives the longitudinal planner behind a lead."""

import bus  # noqa: F401  before Plant opens its sockets
import numpy as np
from openpilot.common.realtime import DT_MDL
from openpilot.selfdrive.test.longitudinal_maneuvers.plant import Plant


class Loop:
    STEP_S = DT_MDL

    def __init__(self, scenario):
        speed, gap = scenario["speed_mps"], scenario["gap_m"]
        self.plant = Plant(lead_relevancy=True, speed=speed, distance_lead=gap)
        self.scenario, self.alerts = scenario, {}

    def truth(self, t):
        lead = float(np.interp(t, self.scenario["times_s"], self.scenario["lead_mps"]))
        gap = self.plant.distance_lead - self.plant.distance
        return {"gap": gap, "speed": self.plant.speed, "lead": lead}

    def step(self, t):
        after = self.plant.step(v_lead=self.truth(t)["lead"], v_cruise=self.scenario["cruise_mps"])
        self.alerts = {"fcw": bool(after["fcw"])}
        target = self.plant.planner.output_a_target
        return {"acceleration": after["acceleration"], "command": after["acceleration"], "target": target}
