"""Brakes for a lead: a stand-in for the solver."""


class LongitudinalMpc:
    def __init__(self):
        self.crash_cnt = 0

    def process_lead(self, lead):
        if lead is not None and lead.status:
            x_lead = lead.dRel
            v_lead = lead.vLead
        else:
            x_lead = 200.0
            v_lead = 40.0
        return x_lead, v_lead

    def update(self, radarstate, v_ego, v_cruise):
        gap, lead = self.process_lead(radarstate.leadOne)
        wish = 0.2 * (gap - 6.0 - 1.5 * v_ego) + 0.8 * (lead - v_ego)
        self.crash_cnt = self.crash_cnt + 1 if wish < -6.0 else 0
        return min(wish, 0.5 * (v_cruise - v_ego))
