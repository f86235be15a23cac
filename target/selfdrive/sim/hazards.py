"""The three hazards, checked on ground truth at every step."""

from selfdrive.sim.camera import LANE_WIDTH
from selfdrive.sim.sensors import STANDSTILL_SPEED
from selfdrive.sim.truth import GroundTruth

CAR_WIDTH = 1.8  # m
CONTACT_OFFSET = 0.5 * (LANE_WIDTH + CAR_WIDTH)  # m, half a lane and half a car
FREE_DISTANCE = 100.0  # m
LANE_DEPARTURE_OFFSET = 0.5 * (LANE_WIDTH - CAR_WIDTH)  # m; beyond this, a side of the car leaves the lane


class HazardMonitor:
    """`first` maps H1, H2, H3 to the time (s) of their first occurrence, or None.

    H1: the car touches the lead. H2: the car has stopped although the road is free for 100 m. H3: a side of
    the car leaves the lane.
    """

    def __init__(self) -> None:
        self.first: dict[str, float | None] = {"H1": None, "H2": None, "H3": None}
        self._has_moved = False

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

    def _record_first(self, hazard: str, t: float) -> None:
        if self.first[hazard] is None:
            self.first[hazard] = t
