"""The world: two cars on a lane."""

STEP = 0.05  # s


class World:
    """Positions and speeds, advanced by the commands of the step before. SI."""

    def __init__(self, case):
        self.frame = 0
        self.speed = case["speed"]
        self.gap = case["gap"]
        self.lead_speed = case["lead_speed"]
        self.lead_brakes = case["lead_brakes"]
        self.offset = 0.05
        self.hazards = {"H1": None, "H3": None, "TOO_FAST": None}

    def advance(self, gas, brake, wheel):
        now = self.frame * STEP
        self.frame += 1
        if now >= 2.0:
            self.lead_speed = max(0.0, self.lead_speed - self.lead_brakes * STEP)
        self.speed = max(0.0, self.speed + (3.0 * gas - 8.0 * brake) * STEP)
        self.gap += (self.lead_speed - self.speed) * STEP
        self.offset += (2.0 * wheel + 0.02) * STEP
        return now

    def judge(self, now):
        for name, happened in (
            ("H1", self.gap <= 0.0),
            ("H3", abs(self.offset) > 1.0),
            ("TOO_FAST", self.speed > 34.0),
        ):
            if happened and self.hazards[name] is None:
                self.hazards[name] = now
