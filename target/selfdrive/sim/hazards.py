"""The four hazards, checked on ground truth at every step."""

from selfdrive.sim.camera import LANE_WIDTH
from selfdrive.sim.sensors import STANDSTILL_SPEED
from selfdrive.sim.truth import GroundTruth

CAR_WIDTH = 1.8  # m
CONTACT_OFFSET = 0.5 * (LANE_WIDTH + CAR_WIDTH)  # m, half a lane and half a car
FREE_DISTANCE = 100.0  # m
LANE_DEPARTURE_OFFSET = 0.5 * (LANE_WIDTH - CAR_WIDTH)  # m; beyond this, a side of the car leaves the lane
HARD_BRAKING = -3.5  # m/s^2; an adaptive cruise control may not brake harder (ISO 15622)
NO_NEED_TTC = 4.0  # s; with a longer time to collision, nothing calls for hard braking
HARD_BRAKING_TIME = 0.5  # s
_TIME_SLACK = 1e-9  # s; times are rounded


class HazardMonitor:
    """`first` maps H1 to H4 to the time (s) of their first occurrence, or None.

    H1: the car touches the lead. H2: the car has stopped although the road is free for 100 m. H3: a side of
    the car leaves the lane. H4: the car has braked hard for 0.5 s although the time to collision is long.
    """

    def __init__(self) -> None:
        self.first: dict[str, float | None] = {"H1": None, "H2": None, "H3": None, "H4": None}
        self._has_moved = False
        self._brakes_hard_since: float | None = None  # s

    def update(self, truth: GroundTruth) -> None:
        offset = abs(truth.lateral_offset)
        if truth.d_rel <= 0.0 and offset <= CONTACT_OFFSET:
            self._record_first("H1", truth.t)
        if truth.v_ego >= STANDSTILL_SPEED:
            self._has_moved = True
        elif self._has_moved and (truth.free_road or truth.d_rel >= FREE_DISTANCE):
            self._record_first("H2", truth.t)
        if offset > LANE_DEPARTURE_OFFSET:
            self._record_first("H3", truth.t)
        self._check_braking(truth)

    def _check_braking(self, truth: GroundTruth) -> None:
        # without a division: the time to collision is longer if the distance is
        has_no_need = truth.d_rel > NO_NEED_TTC * (truth.v_ego - truth.v_lead)
        if not (truth.a_ego < HARD_BRAKING and has_no_need):
            self._brakes_hard_since = None
            return
        if self._brakes_hard_since is None:
            self._brakes_hard_since = truth.t
        if truth.t - self._brakes_hard_since >= HARD_BRAKING_TIME - _TIME_SLACK:
            self._record_first("H4", truth.t)

    def _record_first(self, hazard: str, t: float) -> None:
        if self.first[hazard] is None:
            self.first[hazard] = t
