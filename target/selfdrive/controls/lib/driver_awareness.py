"""Whether the driver is still there: six minutes without a hand on anything, and the car slows down."""

from selfdrive.common.realtime import DT_CTRL

AWARENESS_TIME = 360.0  # s until the car starts to slow down
AWARENESS_PRE_TIME = 20.0  # s before that, a first alert is shown
PRE_ALERT_TIME = 4.0  # s, how long the first alert is shown


class DriverAwareness:
    """Counts down from 1 while engaged; any action of the driver sets it back."""

    def __init__(self) -> None:
        self.status = 1.0

    @property
    def absent(self) -> bool:
        """True when the car has to slow down by itself."""
        return self.status < 0.0

    def count_down(self) -> str:
        """One engaged cycle; returns the alert to raise, or an empty text."""
        self.status -= DT_CTRL / AWARENESS_TIME
        if self.status <= 0.0:
            return "driver_distracted"
        left = self.status * AWARENESS_TIME
        return (
            "pre_driver_distracted"
            if AWARENESS_PRE_TIME - PRE_ALERT_TIME <= left <= AWARENESS_PRE_TIME
            else ""
        )

    def reset(self) -> None:
        """The driver did something, or is driving."""
        self.status = 1.0
