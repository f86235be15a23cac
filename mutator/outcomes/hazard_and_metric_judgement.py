"""Judges a run from its trace and record: hazards, the end of the drive, and metrics."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mutator.errors import BadOutput, MutatorError
from mutator.outcomes.trace_and_record_loading import (
    Trace,
    alert_times,
    load_target_record,
    load_trace,
    values_at_other_steps,
    values_on_steps,
)
from mutator.targets.hazard_and_metric_definitions import Hazard, Metric
from mutator.targets.hazard_severity import DELTA_V_NAME
from mutator.targets.manifest import TargetManifest
from mutator.triggers import temporal_logic, trace_formulas
from mutator.triggers.conditions import GOLDEN_PREFIX, TIME, names_in

ValuesByName = Mapping[str, np.ndarray]

_TIME_SLACK_S = 1e-9  # s; times are sums of steps


@dataclass(frozen=True, slots=True, kw_only=True)
class RunJudgement:
    """The judgement of a run. Times are in s."""

    hazards: tuple[tuple[str, float], ...]  # name, first time, in the order of the manifest
    alerts: tuple[tuple[str, float], ...]  # name, time of every raise
    t_end: float | None  # when a terminal hazard ended the drive
    metrics: tuple[tuple[str, float], ...]  # including margins; metrics without a value are omitted
    is_engaged_at_end: bool = True  # whether the controller drives in the last step; true if nothing says it

    @property
    def hazards_by_time(self) -> tuple[tuple[str, float], ...]:
        """The hazards, the first to come first; those of the same time by name."""
        return tuple(sorted(self.hazards, key=lambda hazard: (hazard[1], hazard[0])))


def load_judged_run(
    manifest: TargetManifest, out: Path, golden: Trace | None = None
) -> tuple[Trace, RunJudgement]:
    """Load and judge the run in `out`; `golden` is as in `judge_run`.

    BadOutput if trace or record is missing or cannot be judged.
    """
    trace = load_manifest_channels(manifest, out)
    return trace, judge_run(manifest, trace, load_target_record(manifest, out), golden)


def load_manifest_channels(manifest: TargetManifest, out: Path) -> Trace:
    """Load the manifest's channels that the run in `out` recorded.

    BadOutput if a channel that the verdict needs is missing.
    """
    needed = {*manifest.compared_channels, *manifest.criteria_channels}
    others = [channel for channel in manifest.channels if channel not in needed]
    return load_trace(manifest, out, [c for c in manifest.channels if c in needed], others)


def judge_run(
    manifest: TargetManifest, trace: Trace, record: Mapping[str, Any], golden: Trace | None = None
) -> RunJudgement:
    """Judge a run. Its trace and that of its golden run must have the channels that the manifest needs for
    judging. Without a golden run (this is one), metrics that use it have no value.
    """
    values = formula_values_by_name(manifest, trace)
    if golden is not None and any(metric.uses_golden for metric in manifest.metrics):
        values = {**values, **_golden_values(formula_values_by_name(manifest, golden), values[TIME])}
    hazards, metrics = [], []
    ends: dict[str, float] = {}
    for hazard in manifest.hazard_rules:
        robustness = _stl_robustness(hazard, values, manifest) if hazard.required_stl else None
        first = _first_hazard_time(hazard, values, robustness, record)
        if first is not None:
            hazards.append((hazard.name, first))
        if (end := _drive_end(hazard, first, values)) is not None:
            ends[hazard.name] = end
        if hazard.margin_metric is not None:
            numbers = (
                robustness
                if robustness is not None
                else trace_formulas.formula_at_each_step(hazard.margin, values)
            )
            metrics.append((hazard.margin_metric, numbers))
    measured = [metric for metric in manifest.metrics if golden is not None or not metric.uses_golden]
    metrics += [(metric, _metric_values(metric, values)) for metric in measured]
    t_end = min(ends.values(), default=None)
    first_by_hazard = dict(hazards)
    value_by_metric = {
        metric.name: _value_at(numbers, values[TIME], first_by_hazard.get(metric.hazard), metric.end_s(t_end))
        if metric.aggregate == "at_hazard"
        else _aggregate_metric(metric, numbers, values, t_end)
        for metric, numbers in metrics
    }
    contact = manifest.contact
    if contact and t_end is not None and ends.get(contact.hazard) == t_end:
        speed = value_by_metric.get(contact.speed_metric)
        value_by_metric[DELTA_V_NAME] = None if speed is None else contact.delta_v_mps(speed)
    return RunJudgement(
        hazards=tuple(hazards),
        alerts=tuple(alert_times(record, manifest.alerts)),
        t_end=t_end,
        metrics=tuple((name, value) for name, value in value_by_metric.items() if value is not None),
        is_engaged_at_end=_is_engaged_at_end(manifest, values),
    )


def is_engaged_at_end(manifest: TargetManifest, trace: Trace) -> bool:
    """Whether the controller drives in the last step of a run; true if the manifest does not say when."""
    return not manifest.engaged or _is_engaged_at_end(manifest, formula_values_by_name(manifest, trace))


def _is_engaged_at_end(manifest: TargetManifest, values: ValuesByName) -> bool:
    if not manifest.engaged or not len(values[TIME]):
        return True
    return bool(trace_formulas.condition_at_each_step(manifest.engaged, values)[-1])


def formula_values_by_name(manifest: TargetManifest, trace: Trace) -> ValuesByName:
    """Return the variables of the manifest's formulas, with a number for each step.

    A channel with its own times keeps its newest value. Before its first value it is NaN.
    """
    time = np.asarray(trace[manifest.time_channel], dtype=float)
    values = {TIME: time}
    for channel in manifest.criteria_channels:
        values[channel.name] = values_on_steps(trace, channel.name, time).astype(float)
    for value in manifest.observation.derived:
        if value.name not in values and all(name in values for name in names_in(value.text)):
            values[value.name] = trace_formulas.formula_at_each_step(value.text, values)
    return values


def _golden_values(golden: ValuesByName, steps: np.ndarray) -> ValuesByName:
    """Return the values of the golden run at the steps of another run; NaN at steps that it does not have."""
    return {
        GOLDEN_PREFIX + name: values_at_other_steps(golden[TIME], numbers, steps)
        for name, numbers in golden.items()
    }


def _stl_robustness(hazard: Hazard, values: ValuesByName, manifest: TargetManifest) -> np.ndarray:
    try:
        return temporal_logic.robustness_at_each_step(hazard.required_stl, values, manifest.step_s)
    except MutatorError as error:
        where = manifest.trace_file
        raise BadOutput(error.got, where=where, expected=error.expected, remedy=error.remedy) from None


def _first_hazard_time(
    hazard: Hazard, values: ValuesByName, robustness: np.ndarray | None, record: Mapping[str, Any]
) -> float | None:
    if hazard.is_in_record:
        return record.get("hazards", {}).get(hazard.name)  # type: ignore[no-any-return]
    holds = (
        robustness < 0.0
        if robustness is not None
        else trace_formulas.condition_at_each_step(hazard.when, values)
    )
    return _first_true_time(_lasted_mask(holds, values[TIME], hazard.for_s), values[TIME])


def _lasted_mask(holds: np.ndarray, time: np.ndarray, for_s: float) -> np.ndarray:
    if not for_s:
        return holds
    begins = holds & ~np.concatenate(([False], holds[:-1]))
    since = np.maximum.accumulate(np.where(begins, time, -np.inf))
    return holds & (time - since >= for_s - _TIME_SLACK_S)


def _first_true_time(holds: np.ndarray, time: np.ndarray) -> float | None:
    at = np.flatnonzero(holds)
    return float(time[at[0]]) if at.size else None


def _drive_end(hazard: Hazard, first: float | None, values: ValuesByName) -> float | None:
    if hazard.terminal_condition == "True":
        return first
    if not hazard.terminal_condition:
        return None
    return _first_true_time(
        trace_formulas.condition_at_each_step(hazard.terminal_condition, values), values[TIME]
    )


def _metric_values(metric: Metric, values: ValuesByName) -> np.ndarray:
    """Return a metric's value at each step; NaN, which is not aggregated, if it needs a golden step that is
    missing.
    """
    if metric.aggregate == "duration":
        numbers = trace_formulas.condition_at_each_step(metric.step_formula, values).astype(float)
    else:
        numbers = trace_formulas.formula_at_each_step(metric.step_formula, values)
    return (
        np.where(np.isnan(values[GOLDEN_PREFIX + TIME]), np.nan, numbers) if metric.uses_golden else numbers
    )


def _value_at(numbers: np.ndarray, time: np.ndarray, at_s: float | None, end_s: float) -> float | None:
    """Return the value in the newest step at a time; None if the time is missing or after the end."""
    if at_s is None or at_s > end_s + _TIME_SLACK_S:
        return None
    steps = np.flatnonzero(time <= at_s + _TIME_SLACK_S)
    return float(numbers[steps[-1]]) if steps.size and math.isfinite(numbers[steps[-1]]) else None


def _aggregate_metric(
    metric: Metric, numbers: np.ndarray, values: ValuesByName, t_end: float | None
) -> float | None:
    """Return the aggregate of a metric up to its end, or None without values.

    Sums are exact (`fsum`), so that they do not depend on the processor.
    """
    time, end = values[TIME], metric.end_s(t_end)
    driven = time <= end + _TIME_SLACK_S if metric.ends_before_s is None else time < end - _TIME_SLACK_S
    if metric.aggregate == "at_end":
        driven &= t_end is not None and time == time[driven].max(initial=-math.inf)
    counts = np.isfinite(numbers) & driven
    if metric.where:
        counts &= trace_formulas.condition_at_each_step(metric.where, values)
    if metric.aggregate in ("integral", "duration"):
        until = np.append(time[1:], time[-1:])  # each value lasts until the next step or the end
        lengths = np.minimum(until, max(end, time[0])) - time
        return math.fsum((numbers[counts] * lengths[counts]).tolist())
    aggregated = numbers[counts]
    if not aggregated.size:
        return None
    if metric.aggregate == "mean":
        return math.fsum(aggregated.tolist()) / int(aggregated.size)
    return float({"min": aggregated.min(), "max": aggregated.max()}.get(metric.aggregate, aggregated[-1]))
