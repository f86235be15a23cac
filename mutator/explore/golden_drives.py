"""The drives of planes: from when faults start to the end, as golden runs show it."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mutator.campaigns.exploration_section import ExploredPlane
from mutator.errors import MutatorError
from mutator.explore.cell_results import MOST_TIME_MARGIN_MS, Drive
from mutator.outcomes.trace_and_record_loading import load_trace, values_on_steps
from mutator.outcomes.trace_files import own_times
from mutator.targets.manifest import TargetManifest
from mutator.triggers.conditions import TIME, names_in
from mutator.triggers.trace_formulas import condition_at_each_step, formula_at_each_step

_MICROSECONDS_PER_S = 1e6
_MILLISECONDS_PER_S = 1e3


def load_observed_values(manifest: TargetManifest, folder: Path) -> Mapping[str, np.ndarray]:
    """Return what the golden run in `folder` recorded of the values that conditions name, for each step."""
    trace = load_trace(manifest, folder, (), manifest.channels)
    times = np.asarray(trace[manifest.time_channel], dtype=float)
    names = {name for name in trace if name != manifest.time_channel} - {own_times(name) for name in trace}
    values = {TIME: times, **{name: values_on_steps(trace, name, times).astype(float) for name in names}}
    for value in manifest.observation.derived:
        if value.name not in values and all(name in values for name in names_in(value.text)):
            values[value.name] = formula_at_each_step(value.text, values)
    return values


def drive_of(manifest: TargetManifest, golden: Mapping[str, np.ndarray], plane: ExploredPlane) -> Drive:
    """Return the drive of a plane, whose golden run has the values `golden`.

    MutatorError if the golden run does not record what the plane's condition names, or never meets it.
    """
    times = golden[TIME]
    if unrecorded := [name for name in names_in(plane.condition) if name not in golden]:
        raise MutatorError(
            f"{plane.start}: the golden run does not record {', '.join(unrecorded)}",
            argument="starts",
            expected="a condition on channels of the manifest",
            remedy="give a time in s, or record these values in channels of the same name",
        )
    holds = condition_at_each_step(plane.condition, golden) & (times >= plane.armed_after_s)
    if not holds.any():
        raise MutatorError(
            f"{plane.scenario}, which ends at {float(times[-1]):g} s, never meets {plane.condition}",
            argument="starts",
            expected="a start that the golden run reaches",
            remedy="choose another start or scenario",
        )
    step = int(np.argmax(holds))
    start = float(times[step])
    # rounded down, so that rounding does not lose a step
    start_s = math.floor(start * _MICROSECONDS_PER_S) / _MICROSECONDS_PER_S
    return Drive(
        start_s=start_s,
        end_s=float(times[-1]),
        step_s=manifest.step_s,
        time_margin_ms=_time_margin_ms(manifest, {name: array[: step + 1] for name, array in golden.items()}),
    )


def _time_margin_ms(manifest: TargetManifest, golden: Mapping[str, np.ndarray]) -> int:
    """Return the shortest time, at the last step of `golden`, of the metrics that are the smallest of a time,
    such as headway and time to collision.
    """
    shortest_ms = float(MOST_TIME_MARGIN_MS)
    for metric in manifest.metrics:
        formulas = [text for text in (metric.step_formula, metric.where) if text]
        is_time = metric.aggregate == "min" and metric.unit == "s" and metric.worse == "lower"
        if not is_time or not all(name in golden for text in formulas for name in names_in(text)):
            continue
        if metric.where and not condition_at_each_step(metric.where, golden)[-1]:
            continue
        time_ms = float(formula_at_each_step(metric.step_formula, golden)[-1]) * _MILLISECONDS_PER_S
        if not math.isnan(time_ms):
            shortest_ms = min(shortest_ms, max(time_ms, 0.0))
    return round(shortest_ms)
