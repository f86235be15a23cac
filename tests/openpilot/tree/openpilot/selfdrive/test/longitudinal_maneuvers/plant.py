"""A car behind a lead, driven by the planner alone."""

from cereal import Content, messaging

from openpilot.common.realtime import DT_MDL
from openpilot.selfdrive.controls.lib.longitudinal_planner import LongitudinalPlanner


class Plant:
    def __init__(self, lead_relevancy=False, speed=0.0, distance_lead=2.0):
        messaging.pub_sock("radarState")
        self.planner = LongitudinalPlanner(None, init_v=speed)
        self.speed, self.distance, self.distance_lead = speed, 0.0, distance_lead

    def step(self, v_lead=0.0, v_cruise=50.0):
        gap = self.distance_lead - self.distance
        radar = Content(leadOne=Content(status=True, dRel=gap, vLead=v_lead))
        state = Content(vEgo=self.speed, vCruise=v_cruise * 3.6)
        self.planner.update(
            {"radarState": radar, "carState": state, "controlsState": Content(forceDecel=False)}
        )
        acceleration = self.planner.output_a_target
        self.speed = max(0.0, self.speed + acceleration * DT_MDL)
        self.distance += self.speed * DT_MDL
        self.distance_lead += v_lead * DT_MDL
        return {"acceleration": acceleration, "fcw": self.planner.fcw}
