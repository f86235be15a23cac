"""The camera's lead vehicle, smoothed for matching with radar tracks."""

from collections.abc import Iterable
from math import hypot

from selfdrive.common.kalman import DistanceFilter
from selfdrive.common.realtime import DT_MDL
from selfdrive.controls.lib.polynomial import Poly, value
from selfdrive.controls.lib.radar_helpers import Track
from selfdrive.messages import LeadVision

MIN_PROB = 0.7  # less probable leads confirm nothing
RATE_VARIANCE = 1e2  # (m/s)^2, about that of a lead of 70 % probability
Q_DISTANCE = 0.5  # m^2, each cycle
Q_RATE = 1.0  # (m/s)^2, each cycle

MAX_DISTANCE = 4.0
MAX_SPEED_DIFF = 10.0  # m/s; cameras estimate speed badly


class VisionPoint:
    """Distance and relative speed of the camera's lead, which only confirms radar tracks.

    As in the original, the camera's distance is from the bumper, a track's from the camera, 2.7 m further
    back; the limits of the match allow for the difference.
    """

    def __init__(self) -> None:
        self._filter = DistanceFilter(variance=RATE_VARIANCE, q_distance=Q_DISTANCE, q_rate=Q_RATE)
        self.valid = False

    def update(self, lead: LeadVision) -> None:
        variance = lead.std * lead.std
        self.valid = lead.prob > MIN_PROB
        if self.valid:
            self._filter.update(lead.d_rel, variance)
            self._filter.predict(DT_MDL)
        else:
            self._filter.restart(lead.d_rel, variance, RATE_VARIANCE)

    def best_match(self, tracks: Iterable[Track], path: Poly) -> Track | None:
        """Return the best match for the camera's lead, assumed to be on the path; None if none is near."""
        if not self.valid:
            return None
        d_rel, v_rel = self._filter.value, self._filter.rate
        y_rel = value(path, d_rel)
        best, best_score = None, MAX_DISTANCE + MAX_SPEED_DIFF
        for track in tracks:
            gap = hypot(0.5 * (d_rel - track.d_rel), 2.0 * (y_rel - track.y_rel))
            v_diff = abs(v_rel - track.v_rel)
            if gap < MAX_DISTANCE and v_diff < MAX_SPEED_DIFF and gap + v_diff < best_score:
                best, best_score = track, gap + v_diff
        return best
