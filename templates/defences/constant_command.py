"""Commands fixed ranges as long as the defence is active: a monitor whose conditions are in its YAML file.

`lowest_NAME` and `highest_NAME` bound the command NAME.
"""

import math

BOUNDS = ("lowest", "highest")  # first words of its parameters


class Model:
    """A range for each command that a parameter names."""

    def __init__(self, **bounds):
        self._ranges = {}
        for key, bound in bounds.items():
            side, _, name = key.partition("_")
            low, high = self._ranges.get(name, (-math.inf, math.inf))
            self._ranges[name] = (bound, high) if side == "lowest" else (low, bound)

    def reset(self):
        """There is no state."""

    def update(self, since_s, sensed, applied):
        """Return the ranges."""
        return self._ranges
