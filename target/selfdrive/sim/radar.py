"""The forward radar: one track at 20 Hz, with the resolution and range of its CAN frames."""

from math import isfinite, sin

from selfdrive.can.dbc import load_dbc
from selfdrive.can.packer import MessagePacker
from selfdrive.car.honda.values import RADAR_BUS, RADAR_DBC, RADAR_STATE_GOOD
from selfdrive.common.interp import clip
from selfdrive.messages import CanFrame
from selfdrive.sim.road import Road
from selfdrive.sim.truth import GroundTruth

DISTANCE_COUNTS_PER_M = 16.0  # per m
SPEED_COUNTS_PER_MPS = 32.0  # per m/s
LATERAL_COUNTS_PER_M = 16.0  # per m
MOST_LATERAL_DISTANCE = 31.0  # m to a side, the range of the lateral field


class RadarSensor:
    """Measures the lead and reports it on the radar bus."""

    def __init__(self, road: Road) -> None:
        self._road = road
        messages = load_dbc(RADAR_DBC)
        self._state = MessagePacker(messages["RADAR_DIAGNOSTIC"], ("RADAR_STATE",), RADAR_BUS)
        self._track = messages["TRACK_15"]

    def measure(self, truth: GroundTruth) -> list[CanFrame]:
        """Return the state and track frames of one cycle.

        As in the original, counts are truncated towards zero and wrap around: 256 m reads 0. Faults can cause
        such distances.
        """
        d_rel = truth.d_rel
        v_rel = truth.v_lead - truth.v_ego
        y_rel = self._road.sideways(truth.position, truth.d_rel)
        y_rel -= truth.lateral_offset + sin(truth.heading) * truth.d_rel
        frames: list[CanFrame] = []
        frames.extend(self._pack(max(d_rel, 0.0), v_rel, y_rel))
        return frames

    def _pack(self, d_rel: float, v_rel: float, y_rel: float) -> tuple[CanFrame, ...]:
        counts = {
            "LONG_DIST": _counts(d_rel, DISTANCE_COUNTS_PER_M),
            "REL_SPEED": _counts(v_rel, SPEED_COUNTS_PER_MPS),
            "LAT_DIST": _counts(
                clip(-y_rel, -MOST_LATERAL_DISTANCE, MOST_LATERAL_DISTANCE), LATERAL_COUNTS_PER_M
            ),
        }
        word = 0
        for name, raw in counts.items():
            field = self._track.fields[name]
            word |= (raw & field.mask) << field.shift
        track = CanFrame(self._track.address, word.to_bytes(self._track.size, "big"), RADAR_BUS)
        return self._state.pack((RADAR_STATE_GOOD,)), track


def _counts(value: float, per_unit: float) -> int:
    return int(value * per_unit) if isfinite(value) else 0
