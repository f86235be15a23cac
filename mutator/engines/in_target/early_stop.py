"""Run a target to its end, or until a function says to stop. Standard library only."""

import math
from collections.abc import Callable, Mapping
from typing import Any


def drive_run(run: Any, stop_source: str | None) -> bool:
    """Execute the steps of a run; return whether it was stopped early.

    `stop_source` defines a function that decides after each step whether to stop; None: run to the end.
    """
    if stop_source is None:
        while not run.done:
            run.step()
        return False
    should_stop = compile_stop_condition(stop_source)
    recorded = run.recorded  # if it is missing, fail here, before the fault is active
    while not run.done:
        run.step()
        if should_stop(recorded()):
            return not run.done
    return False


def compile_stop_condition(source: str) -> Callable[[Mapping[str, float]], bool]:
    names = {"abs": abs, "min": min_or_nan, "max": max_or_nan, "float": float}
    namespace: dict[str, Any] = {"__builtins__": names, "math": math}
    exec(source, namespace)
    should_stop: Callable[[Mapping[str, float]], bool] = namespace["over"]
    return should_stop


def min_or_nan(*values: float) -> float:
    """Return the smallest number; NaN if any is NaN, as in a trace. Python's `min` depends on the order."""
    return math.nan if any(map(math.isnan, values)) else min(values)


def max_or_nan(*values: float) -> float:
    return math.nan if any(map(math.isnan, values)) else max(values)
