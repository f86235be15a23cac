"""Run to the end, or to the first terminal hazard. Standard library only."""

import math
from collections.abc import Callable, Mapping
from typing import Any


def drive(run: Any, source: str | None) -> bool:
    """Make the steps of a run; returns whether it was stopped.

    `source` has the function that says after each step whether the drive is over (None: it never is).
    """
    if source is None:
        while not run.done:
            run.step()
        return False
    over = compiled(source)
    recorded = run.recorded  # now: a run without it must not reach its activation
    while not run.done:
        run.step()
        if over(recorded()):
            return not run.done
    return False


def compiled(source: str) -> Callable[[Mapping[str, float]], bool]:
    """The function `over` of the source."""
    names = {"abs": abs, "min": least, "max": greatest, "float": float}
    space: dict[str, Any] = {"__builtins__": names, "math": math}
    exec(source, space)
    over: Callable[[Mapping[str, float]], bool] = space["over"]
    return over


def least(*values: float) -> float:
    """The least number; NaN if one is NaN, as over a trace. Python's `min` depends on the order."""
    return math.nan if any(map(math.isnan, values)) else min(values)


def greatest(*values: float) -> float:
    """The greatest number, with the same rule."""
    return math.nan if any(map(math.isnan, values)) else max(values)
