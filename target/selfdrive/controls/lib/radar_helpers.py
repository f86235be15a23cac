"""Radar tracks and their clusters."""

from collections.abc import Sequence
from math import dist, pi

from selfdrive.common.interp import clip, interp
from selfdrive.common.kalman import SteadyKalman
from selfdrive.common.ordered import total
from selfdrive.common.realtime import DT_MDL
from selfdrive.messages import LeadData

LEAD_GAINS = (0.1988689, 0.28555364)  # of the lead speed's Kalman filter at 20 Hz

STATIONARY_SPEED = 4.0  # m/s; slower objects can be stationary
ONCOMING_SPEED = -3.9  # m/s
STATIONARY_MIN_EGO = 4.0  # m/s; below this, no object is treated as stationary

LAT_FILTER = 2.0 * pi * 0.2 * DT_MDL / (1.0 + 2.0 * pi * 0.2 * DT_MDL)  # low pass of 0.2 Hz
A_REL_FILTER = 2.0 * pi * 0.5 * DT_MDL / (1.0 + 2.0 * pi * 0.5 * DT_MDL)  # low pass of 0.5 Hz
A_REL_MAX = 10.0  # m/s^2

CLUSTER_DISTANCE = 2.5  # between centroids, in the space of `cluster_tracks`
LANE_HALF = 1.5  # m from the path; nearer objects are ahead of the car
CUT_IN_MAX = 1.0  # m of correction for lateral speed
SECOND_GAP = 8.0  # m; closer and as fast as the first lead: the same vehicle
SECOND_SPEED = 1.0  # m/s

FUSIONS_FOR_MOVING = 3  # cycles, 0.15 s
FUSIONS_FOR_FCW = 20


class Track:
    """One radar track over time. Distances in m from the camera, left positive; speeds in m/s."""

    __slots__ = (
        "a_rel",
        "d_path",
        "d_rel",
        "filter",
        "fusions",
        "oncoming",
        "stationary",
        "v_lat",
        "v_lead",
        "v_rel",
        "y_rel",
    )

    def __init__(self, d_rel: float, y_rel: float, v_rel: float, d_path: float, v_ego: float) -> None:
        self.filter = SteadyKalman(v_rel + v_ego, 0.0, dt=DT_MDL, gains=LEAD_GAINS)
        self.a_rel = 0.0
        self.v_lat = 0.0
        self.fusions = 0
        self.stationary = True
        self._take(d_rel, y_rel, v_rel, d_path, v_ego)

    def update(
        self, d_rel: float, y_rel: float, v_rel: float, d_path: float, v_ego: float, driver_steers: bool
    ) -> None:
        a_rel = clip((v_rel - self.v_rel) / DT_MDL, -A_REL_MAX, A_REL_MAX)
        self.a_rel += A_REL_FILTER * (a_rel - self.a_rel)
        # while the driver steers, the distance from the path does not show the object's motion
        v_lat = 0.0 if driver_steers else (d_path - self.d_path) / DT_MDL
        self.v_lat += LAT_FILTER * (v_lat - self.v_lat)
        self.filter.update(v_rel + v_ego)
        self._take(d_rel, y_rel, v_rel, d_path, v_ego)

    def _take(self, d_rel: float, y_rel: float, v_rel: float, d_path: float, v_ego: float) -> None:
        self.d_rel = d_rel
        self.y_rel = y_rel
        self.v_rel = v_rel
        self.d_path = d_path
        self.v_lead = v_rel + v_ego
        # an object that has moved is never treated as stationary again
        self.stationary = (
            self.stationary and v_ego > STATIONARY_MIN_EGO and abs(self.v_lead) < STATIONARY_SPEED
        )
        self.oncoming = self.v_lead < ONCOMING_SPEED

    def fuse(self) -> None:
        """Count a match with the camera. An object that is matched often enough is not stationary."""
        self.fusions += 1
        if self.fusions >= FUSIONS_FOR_MOVING:
            self.stationary = False


class Cluster:
    """Tracks treated as one vehicle; values are means."""

    __slots__ = ("_tracks", "d_path", "d_rel", "v_lat", "v_rel")

    def __init__(self, tracks: Sequence[Track]) -> None:
        self._tracks = tracks
        self.d_rel = self._mean([t.d_rel for t in tracks])
        self.v_rel = self._mean([t.v_rel for t in tracks])
        self.d_path = self._mean([t.d_path for t in tracks])
        self.v_lat = self._mean([t.v_lat for t in tracks])

    def _mean(self, values: Sequence[float]) -> float:
        if len(values) == 1:  # the usual case
            return 0.0 + values[0]
        return total(values) / len(self._tracks)

    def is_lead(self, v_ego: float) -> bool:
        """Return whether the cluster drives ahead of the car or is about to cut in."""
        if all(t.stationary for t in self._tracks) or all(t.oncoming for t in self._tracks):
            return False
        # lateral speed has more weight for closer vehicles, because the path is uncertain far ahead
        horizon = interp(self.d_rel, (10.0, 40.0 + v_ego / 1.2), (1.0, 0.0))
        correction = clip(horizon * self.v_lat, -CUT_IN_MAX, CUT_IN_MAX)
        moved = self.d_path + correction
        return abs(clip(moved, min(0.0, self.d_path), max(0.0, self.d_path))) < LANE_HALF

    def is_apart(self, first: "Cluster") -> bool:
        return self.d_rel - first.d_rel > SECOND_GAP or abs(self.v_rel - first.v_rel) > SECOND_SPEED

    def lead_data(self, radar_offset: float) -> LeadData:
        """Return the message; its distance is from the front bumper."""
        mean, tracks = self._mean, self._tracks
        return LeadData(
            status=True,
            d_rel=self.d_rel - radar_offset,
            y_rel=mean([t.y_rel for t in tracks]),
            v_rel=self.v_rel,
            a_rel=mean([t.a_rel for t in tracks]),
            v_lead=mean([t.v_lead for t in tracks]),
            d_path=self.d_path,
            v_lat=self.v_lat,
            v_lead_k=mean([t.filter.value for t in tracks]),
            a_lead_k=mean([t.filter.rate for t in tracks]),
            fcw=max(t.fusions for t in tracks) >= FUSIONS_FOR_FCW,
        )


def cluster_tracks(tracks: Sequence[Track]) -> list[Cluster]:
    """Cluster by centroid linkage on (distance, twice the lateral position, speed) up to a distance of 2.5.

    Lateral positions have double weight because the radar measures them badly.
    """
    groups = [((t.d_rel, 2.0 * t.y_rel, t.v_rel), [t]) for t in tracks]
    while len(groups) > 1:
        gap, i, j = min(
            (dist(groups[i][0], groups[j][0]), i, j)
            for i in range(len(groups))
            for j in range(i + 1, len(groups))
        )
        if not gap <= CLUSTER_DISTANCE:
            break
        (p, first), (q, second) = groups[i], groups.pop(j)
        n, m = len(first), len(second)
        center = tuple((a * n + b * m) / (n + m) for a, b in zip(p, q, strict=True))
        groups[i] = (center, first + second)
    return [Cluster(members) for _, members in groups]
