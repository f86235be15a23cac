"""Finds observed values that a run lost: from some step on they are NaN, or infinite, instead of a number.

A value is observed if the manifest's `observation.values` has it, and visible here if a channel of its name
records it (`check` lists the others). Derived values are not judged, because they can be infinite by
definition (a headway at standstill).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mutator.outcomes.trace_and_record_loading import Trace, newest_values, values_on_steps
from mutator.targets.manifest import TargetManifest

LOST_VALUE_PREFIX = "truth: "  # begins the detail of a crash by a lost value
_TIME_SLACK_S = 1e-9  # times are sums of steps, which round


@dataclass(frozen=True, slots=True, kw_only=True)
class LostValue:
    """An observed value, what it is instead of a number, and the time (s) of the first such step."""

    name: str
    instead: str
    time_s: float

    def __str__(self) -> str:
        return f"{LOST_VALUE_PREFIX}{self.name} is {self.instead} at {self.time_s:.10g} s"


def find_lost_value(
    manifest: TargetManifest, golden: Trace, faulty: Trace, t_end: float | None
) -> LostValue | None:
    """Return the observed value that is lost first in the drive, which ends at `t_end`, or None.

    It is NaN where the golden run's is not, or infinite where the golden run's is finite. A step that the
    golden run does not have is compared with the golden run's newest one. A fault can move the time at which
    there is something to observe. So NaN before the first number, and in a value that the golden run itself
    loses, is legitimate, and so is the infinity by which the golden run says in another step that there is
    nothing. NaN is also what broken arithmetic gives, so it is excused in fewer cases.
    """
    steps, golden_steps = (np.asarray(trace[manifest.time_channel], float) for trace in (faulty, golden))
    lost: list[LostValue] = []
    for name in _recorded_names(manifest, golden, faulty):
        values = values_on_steps(faulty, name, steps).astype(float)
        if np.isfinite(values).all():  # what follows is slow
            continue
        golden_values = values_on_steps(golden, name, golden_steps).astype(float)
        reference = newest_values(golden_steps, golden_values, steps)
        is_nan = np.isnan(values) & ~np.isnan(reference) & ~_nan_allowed_mask(golden_values, values)
        is_unexpected = np.isinf(values) & ~np.isin(values, golden_values)
        lost_now = is_nan | is_unexpected & np.isfinite(reference)
        at = np.flatnonzero(lost_now & _steps_in_drive(steps, t_end))
        if at.size:
            instead = "NaN" if np.isnan(values[at[0]]) else "infinite"
            lost.append(LostValue(name=name, instead=instead, time_s=float(steps[at[0]])))
    return min(lost, key=lambda value: value.time_s, default=None)


def _nan_allowed_mask(golden_values: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the steps in which NaN can mean that there is nothing to observe, such as no vehicle ahead."""
    is_absent = np.isnan(golden_values)
    if np.any(is_absent[1:] & ~is_absent[:-1]):
        return np.ones(values.size, bool)
    not_yet = np.logical_and.accumulate(np.isnan(values))
    return not_yet if is_absent[:1].any() else np.zeros(values.size, bool)


def find_value_lost_for_good(manifest: TargetManifest, trace: Trace, t_end: float | None) -> LostValue | None:
    """Return the observed value that first becomes NaN and stays so to the end of the drive, or None.

    A value can be NaN for some time, or never a number, if there is nothing to observe.
    """
    steps = np.asarray(trace[manifest.time_channel], float)
    driven = _steps_in_drive(steps, t_end)
    lost: list[LostValue] = []
    for name in _recorded_names(manifest, trace):
        is_number = ~np.isnan(values_on_steps(trace, name, steps).astype(float)[driven])
        last_number = np.flatnonzero(is_number)[-1:]
        if last_number.size and last_number[0] + 1 < is_number.size:
            time_s = float(steps[driven][last_number[0] + 1])
            lost.append(LostValue(name=name, instead="NaN", time_s=time_s))
    return min(lost, key=lambda value: value.time_s, default=None)


def _recorded_names(manifest: TargetManifest, *traces: Trace) -> Iterator[str]:
    for value in manifest.observation.values:
        if all(value.name in trace for trace in traces):
            yield value.name


def _steps_in_drive(steps: np.ndarray, t_end: float | None) -> np.ndarray:
    return steps <= (np.inf if t_end is None else t_end + _TIME_SLACK_S)
