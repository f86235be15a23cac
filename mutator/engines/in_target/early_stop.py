"""Run a target to its end, or to the first terminal hazard. Standard library only."""

import math
from collections.abc import Callable, Mapping
from typing import Any


def drive(run: Any, source: str | None) -> bool:
    """Execute the steps of a run; return whether it was stopped early.

    `source` defines a function that decides after each step whether to stop; None: run to the end.
    """
    if source is None:
        while not run.done:
            run.step()
        return False
    over = compiled(source)
    recorded = run.recorded  # if it is missing, fail here, before the fault is active
    while not run.done:
        run.step()
        if over(recorded()):
            return not run.done
    return False


def compiled(source: str) -> Callable[[Mapping[str, float]], bool]:
    names = {"abs": abs, "min": least, "max": greatest, "float": float}
    space: dict[str, Any] = {"__builtins__": names, "math": math}
    exec(source, space)
    over: Callable[[Mapping[str, float]], bool] = space["over"]
    return over


def least(*values: float) -> float:
    """Return the smallest number; NaN if any is NaN, as in a trace. Python's `min` depends on the order."""
    return math.nan if any(map(math.isnan, values)) else min(values)


def greatest(*values: float) -> float:
    return math.nan if any(map(math.isnan, values)) else max(values)
