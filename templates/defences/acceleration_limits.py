"""Limits what the car's commands do, along and across the road, where the commands are pedals and a torque.

It reads `highest_gas` and `highest_brake`, the pedals that give the largest acceleration and deceleration;
`lateral_acceleration` (m/s^2, left positive); `holding_torque`, which keeps the steering wheel where it is;
and `jerk_per_torque` (m/s^3), the lateral jerk for each torque beyond that.

A command that is not a finite number cannot pass: the runtime puts the value of the step before in its place,
or 0 without one, and limits that.
"""

import math


class Model:
    """`lateral_acceleration_limit` is in m/s^2, `lateral_jerk_limit` in m/s^3."""

    def __init__(self, *, lateral_acceleration_limit, lateral_jerk_limit):
        self._acceleration, self._jerk = lateral_acceleration_limit, lateral_jerk_limit

    def reset(self):
        """There is no state."""

    def update(self, since_s, sensed, applied):
        """Return ranges for the pedals and the torque."""
        holding, gain = sensed["holding_torque"], sensed["jerk_per_torque"]
        acceleration = sensed["lateral_acceleration"]
        more = self._jerk / gain if gain > 0.0 else math.inf
        # at the limit of acceleration, the wheel may only come back
        to_left = 0.0 if acceleration >= self._acceleration else more
        to_right = 0.0 if acceleration <= -self._acceleration else more
        return {
            "gas": _range(-math.inf, sensed["highest_gas"]),
            "brake": _range(-math.inf, sensed["highest_brake"]),
            "steer": _range(holding - to_right, holding + to_left),
        }


def _range(low, high):
    """Return the range; a bound limits nothing if what gives it is not a number, or infinite."""
    return (low if low < math.inf else -math.inf, high if high > -math.inf else math.inf)
