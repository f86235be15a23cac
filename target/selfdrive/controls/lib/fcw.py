"""Forward collision warning: all conditions must hold for a while."""

from collections.abc import Sequence
from math import inf, sqrt

from selfdrive.common.interp import interp
from selfdrive.messages import CarState, LeadData

MAX_TTC = 5.0  # s
WARN_TTC = 2.5  # s
LEAD_STOP_TIME = 2.0  # s, minimum time in which a lead is assumed to stop
COUNT_ENOUGH = 10.0
SEEN_STEP = 0.33  # COUNT_ENOUGH is reached after 31 cycles with a lead
BLINKER_STEP = 10.0 / 60.0  # no blinker for 3 s
MIN_INTERVAL = 5.0  # s between warnings
A_HARD = -3.0  # m/s^2, a plan that brakes harder always qualifies
HARD_NODES = slice(1, 20)  # of the plan: 0.2..9.4 s
BRAKING_NODES = slice(1, 15)  # 0.2..6.4 s
A_THRESHOLD = ((0.0, 30.0), (-3.0, -2.0))  # m/s^2 over the lead's speed in m/s


def time_to_collision(v_ego: float, a_ego: float, lead: LeadData) -> float:
    """Return the seconds until the gap closes at constant accelerations; at most 5."""
    v_closing = v_ego - lead.v_lead
    a_closing = min(a_ego - lead.a_lead_k, lead.v_lead / LEAD_STOP_TIME)
    root = v_closing * v_closing + 2.0 * lead.d_rel * a_closing
    if root < 0.1 or sqrt(root) + v_closing < 0.1:
        return MAX_TTC
    return min(2.0 * lead.d_rel / (sqrt(root) + v_closing), MAX_TTC)


class FcwChecker:
    """Counts, at 20 Hz, how long each condition has held for the first lead."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._last_warning = -inf  # s
        self._v_lead_max = 0.0
        self._speed = self._ttc = self._lead_moved = self._closing = 0
        self._centered = self._no_crossing = 0
        self._seen = self._no_blinker = 0.0

    def update(self, t: float, car: CarState, lead: LeadData, a_plan: Sequence[float]) -> bool:
        """Return whether to warn the driver now; `a_plan` is the planned acceleration at 21 nodes (m/s^2)."""
        self._v_lead_max = max(self._v_lead_max, lead.v_lead)
        if not lead.fcw:
            return False
        allowed = self._count(car, lead)
        braking = min(a_plan[BRAKING_NODES]) - min(0.0, car.a_ego)
        hard = min(a_plan[HARD_NODES]) < A_HARD or braking < interp(lead.v_lead, *A_THRESHOLD)
        if allowed and hard and t - self._last_warning > MIN_INTERVAL:
            self._last_warning = t
            return True
        return False

    def _count(self, car: CarState, lead: LeadData) -> bool:
        self._speed = self._speed + 1 if car.v_ego > 5.0 else 0
        self._ttc = self._ttc + 1 if time_to_collision(car.v_ego, car.a_ego, lead) < WARN_TTC else 0
        self._lead_moved = self._lead_moved + 1 if self._v_lead_max > 2.5 else 0
        self._closing = self._closing + 1 if car.v_ego > lead.v_lead else 0
        self._seen += SEEN_STEP
        self._centered = self._centered + 1 if abs(lead.y_rel) < 1.0 else 0
        self._no_crossing = self._no_crossing + 1 if abs(lead.v_lat) < 0.4 else 0
        blinking = car.left_blinker or car.right_blinker
        self._no_blinker = 0.0 if blinking else self._no_blinker + BLINKER_STEP
        counters = (self._speed, self._ttc, self._lead_moved, self._closing)
        return min(*counters, self._seen, self._centered, self._no_crossing, self._no_blinker) >= COUNT_ENOUGH
