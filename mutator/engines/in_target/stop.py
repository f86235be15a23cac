"""Drives a run to its end, or to its first terminal hazard. Standard library only."""

import math
from collections.abc import Callable, Mapping
from typing import Any


def divide(a: float, b: float) -> float:
    """a / b as IEEE 754 has it, never an exception."""
    if b:
        return a / b
    return math.nan if a == 0.0 or a != a else math.copysign(math.inf, a) * math.copysign(1.0, b)


def drive(run: Any, source: str | None) -> bool:
    """Make the steps of a run; was it stopped? `source` has the function that says after each whether the
    drive is over (None: it never is)."""
    if source is None:
        while not run.done:
            run.step()
        return False
    over = compiled(source)
    recorded = run.recorded  # now: a run that has none must not come to its activation
    while not run.done:
        run.step()
        if over(recorded()):
            return not run.done
    return False


def compiled(source: str) -> Callable[[Mapping[str, float]], bool]:
    """The function `over` of the source."""
    names = {"abs": abs, "min": min, "max": max, "float": float}
    space: dict[str, Any] = {"__builtins__": names, "math": math, "_div": divide}
    exec(source, space)
    over: Callable[[Mapping[str, float]], bool] = space["over"]
    return over
