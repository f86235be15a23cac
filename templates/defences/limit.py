"""Limits commands: to a range, and in how fast they change.

`lowest_NAME` and `highest_NAME` bound the command NAME; `rate_NAME` is its largest change per second, from
the value that reached the plant in the step before.

A command that is not a finite number cannot pass: the runtime puts the value of the step before in its place,
or 0 without one, and limits that.
"""

import math

BOUNDS = ("lowest", "highest", "rate")  # first words of its parameters
_UNLIMITED = {"lowest": -math.inf, "highest": math.inf, "rate": math.inf}


class Model:
    """A range for each command that a parameter names."""

    def __init__(self, **bounds):
        self._bounds = {}
        for key, bound in bounds.items():
            side, _, name = key.partition("_")
            self._bounds.setdefault(name, dict(_UNLIMITED))[side] = bound
        self._before_s = None

    def reset(self):
        self._before_s = None

    def update(self, since_s, sensed, applied):
        """Return the ranges; in the first step there is no limit to a change."""
        step_s = math.inf if self._before_s is None else since_s - self._before_s
        self._before_s = since_s
        return {name: self._range(limits, applied[name], step_s) for name, limits in self._bounds.items()}

    def _range(self, limits, before, step_s):
        most = limits["rate"] * step_s
        low, high = limits["lowest"], limits["highest"]
        if most < math.inf:
            # a value outside of the range comes back no faster than the rate allows
            low = min(max(low, before - most), before + most)
            high = max(min(high, before + most), before - most)
        return low, high
