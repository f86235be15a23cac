"""A driver who brakes some time after the defence becomes active, and never steers."""

import math


class Model:
    """After `reaction_s`, the brake rises along a logistic curve: its half comes `half_s` (s) later, and
    `steepness` (1/s) is its growth rate. Fully pressed, it gives `full_deceleration` (m/s^2).

    With `presses_pedal` 1, the driver presses the brake pedal, which the controller reads; with 0, the
    controller does not notice that somebody brakes.
    """

    def __init__(self, *, reaction_s, half_s, steepness, full_deceleration, presses_pedal=0.0):
        self._reaction_s, self._half_s, self._steepness = reaction_s, half_s, steepness
        self._full_deceleration, self._presses_pedal = full_deceleration, presses_pedal

    def reset(self):
        """There is no state."""

    def update(self, since_s, sensed, applied):
        """Return nothing while the driver reacts; then no gas, and at least the driver's brake."""
        if since_s < self._reaction_s:
            return {}
        exponent = self._steepness * (since_s - self._reaction_s - self._half_s)
        share = 0.5 + 0.5 * math.tanh(0.5 * exponent)  # the logistic function, without an overflow
        ranges = {"gas": (-math.inf, 0.0), "deceleration": (share * self._full_deceleration, math.inf)}
        return ranges | ({"brake_pedal": (1.0, 1.0)} if self._presses_pedal else {})
