"""The camera: positions of lane and lead seen from the car, at 20 Hz."""

from math import tan

from selfdrive.messages import VIEW_LENGTH, CameraView
from selfdrive.sim.road import Road
from selfdrive.sim.truth import GroundTruth

LANE_WIDTH = 3.7  # m

_STRAIGHT = (0.0,) * VIEW_LENGTH
_METRES_AHEAD = tuple(float(x) for x in range(VIEW_LENGTH))


class GeometryCamera:
    def __init__(self, road: Road) -> None:
        self._road = road

    def look(self, truth: GroundTruth) -> CameraView:
        middle = -truth.lateral_offset
        return CameraView(
            left_lane_y=middle + 0.5 * LANE_WIDTH,
            right_lane_y=middle - 0.5 * LANE_WIDTH,
            path_y=middle,
            bend=self._bend(truth),
            lead_d_rel=truth.d_rel,
        )

    def _bend(self, truth: GroundTruth) -> tuple[float, ...]:
        road = self._road.bend(truth.position, VIEW_LENGTH)
        if truth.heading == 0.0:
            return road or _STRAIGHT
        slope = -tan(truth.heading)
        if road is None:
            return tuple([slope * x for x in _METRES_AHEAD])
        return tuple([y + slope * x for x, y in zip(_METRES_AHEAD, road, strict=True)])
