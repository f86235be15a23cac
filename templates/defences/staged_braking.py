"""Brakes in three stages, the harder the less time is left, and never more weakly than before.

A stage begins when the time to collision (`ttc`, s) is below the time in which the car (`v_ego`, m/s) would
stop at the stage's deceleration.
"""

import math


class Model:
    """`stops_at_N` (m/s^2) says when stage N begins, `deceleration_N` (m/s^2) how hard it brakes. The first
    stage begins when the defence becomes active.
    """

    def __init__(self, *, stops_at_2, stops_at_3, deceleration_1, deceleration_2, deceleration_3):
        self._first = deceleration_1
        self._later_stages = ((stops_at_2, deceleration_2), (stops_at_3, deceleration_3))
        self.reset()

    def reset(self):
        self._deceleration = self._first

    def update(self, since_s, sensed, applied):
        """Return no gas, and at least the deceleration of the highest stage so far."""
        for stops_at, deceleration in self._later_stages:
            if sensed["ttc"] < sensed["v_ego"] / stops_at:
                self._deceleration = max(self._deceleration, deceleration)
        lowest = self._deceleration
        return {"gas": (-math.inf, 0.0), "deceleration": (lowest, math.inf)}
