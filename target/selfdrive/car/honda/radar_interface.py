"""Reads tracks from the radar's CAN frames (bus 1)."""

from collections.abc import Sequence

from selfdrive.can.dbc import load_dbc
from selfdrive.can.parser import CanParser
from selfdrive.car.honda.values import (
    NO_TRACK_DISTANCE,
    RADAR_BUS,
    RADAR_DBC,
    RADAR_MESSAGES,
    RADAR_STATE_GOOD,
)
from selfdrive.messages import CanFrame, RadarData, RadarPoint

_LAST_MESSAGE_OF_CYCLE = "TRACK_15"


class RadarInterface:
    """Collects one radar cycle (20 Hz): a state frame, then the track frame that completes it."""

    def __init__(self) -> None:
        self._parser = CanParser(load_dbc(RADAR_DBC), RADAR_MESSAGES, RADAR_BUS)
        self._track_id = 0
        self._tracking = False

    def update(self, frames: Sequence[CanFrame], t: float) -> RadarData | None:
        """Process the frames of the step at `t` (s); return RadarData when a cycle is complete, else None.

        A silent radar gives no error, so the receiver must check the age of the data.
        """
        parser = self._parser
        parser.update(frames, t)
        if _LAST_MESSAGE_OF_CYCLE not in parser.updated:
            return None
        errors = []
        if not parser.valid:
            errors.append("comm_issue")
        if parser.values["RADAR_DIAGNOSTIC"][0] != RADAR_STATE_GOOD:
            errors.append("fault")
        return RadarData(t, self._points(), tuple(errors))

    def _points(self) -> tuple[RadarPoint, ...]:
        distance, lateral, speed = self._parser.values[_LAST_MESSAGE_OF_CYCLE]
        if distance >= NO_TRACK_DISTANCE:
            self._tracking = False
            return ()
        if not self._tracking:  # a track that reappears is a new object
            self._tracking = True
            self._track_id += 1
        return (RadarPoint(self._track_id, distance, -lateral, speed),)
