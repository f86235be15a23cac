"""The vehicle ahead."""

from collections.abc import Sequence

from selfdrive.common.interp import interp
from selfdrive.common.realtime import DT_CTRL


class LeadVehicle:
    def __init__(self, gap: float, times: Sequence[float], speeds: Sequence[float]) -> None:
        self.position = gap  # m, rear bumper
        self.speed = speeds[0]
        self._times, self._speeds = times, speeds

    def step(self, t: float) -> None:
        self.speed = interp(t, self._times, self._speeds)
        self.position += DT_CTRL * self.speed
