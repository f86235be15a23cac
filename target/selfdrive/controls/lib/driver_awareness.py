"""Slows the car down after six minutes without any driver action."""

from selfdrive.common.realtime import DT_CTRL

AWARENESS_TIME = 360.0  # s until the car starts to slow down
AWARENESS_PRE_TIME = 20.0  # s before that, a first alert is shown
PRE_ALERT_TIME = 4.0  # s, duration of the first alert


class DriverAwareness:
    """Counts down from 1 while engaged; any driver action resets it."""

    def __init__(self) -> None:
        self.status = 1.0

    @property
    def absent(self) -> bool:
        return self.status < 0.0

    def count_down(self) -> str:
        """Count one engaged cycle; return the alert to raise, or an empty string."""
        self.status -= DT_CTRL / AWARENESS_TIME
        if self.status <= 0.0:
            return "driver_distracted"
        remaining = self.status * AWARENESS_TIME
        return (
            "pre_driver_distracted"
            if AWARENESS_PRE_TIME - PRE_ALERT_TIME <= remaining <= AWARENESS_PRE_TIME
            else ""
        )

    def reset(self) -> None:
        self.status = 1.0
