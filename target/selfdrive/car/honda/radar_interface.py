"""The radar's CAN frames (bus 1) to tracks."""

from collections.abc import Sequence

from selfdrive.messages import CanFrame, RadarData


class RadarInterface:
    """Collects one radar cycle: state frame, then the track frame that completes it (20 Hz)."""

    def __init__(self) -> None: ...

    def update(self, frames: Sequence[CanFrame], t: float) -> RadarData | None:
        """Take the frames of this step at time `t` (s); a RadarData when a cycle is complete, else None.

        A radar that falls silent gives None for ever: its age is for the receiver to judge.
        """
        raise NotImplementedError
