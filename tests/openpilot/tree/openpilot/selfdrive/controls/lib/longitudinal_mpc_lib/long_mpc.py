"""Brakes for a lead: a stand-in for the solver."""

FAR_M, FAST_MPS = 200.0, 40.0  # of a lead that is no obstacle
STOP_M, HEADWAY_S, ALARM_ACCEL = 6.0, 1.5, -6.0


class LongitudinalMpc:
    def __init__(self):
        self.alarmed_steps = 0

    def process_lead(self, lead):
        if lead is not None and lead.status:
            x_lead = lead.dRel
            v_lead = lead.vLead
            return x_lead, v_lead
        return FAR_M, FAST_MPS

    def update(self, radarstate, v_ego, v_cruise):
        gap, speed = self.process_lead(radarstate.leadOne)
        spare_m = gap - STOP_M - HEADWAY_S * v_ego
        accel = 0.2 * spare_m + 0.8 * (speed - v_ego)
        self.alarmed_steps = (self.alarmed_steps + 1) * (accel < ALARM_ACCEL)
        return min(accel, 0.5 * (v_cruise - v_ego))
