"""How the car reacted to a fault: the first actuator that left golden, in which direction, and the speeds
that followed.
"""

import math
from collections.abc import Sequence

import numpy as np

from mutator.model import ObservedActivation, RunEnd
from mutator.outcomes.golden_trace_comparison import (
    channel_deviation,
    signed_differences,
    values_at_common_time,
)
from mutator.outcomes.hazard_and_metric_judgement import formula_values_by_name
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest
from mutator.targets.stored_phrases import (
    GOLDEN_HIGHEST_SPEED,
    GOLDEN_LOWEST_SPEED,
    HIGHER,
    HIGHEST_SPEED,
    LOWER,
    LOWEST_SPEED,
    NO_NUMBER,
    SPEED_AT_ACTIVATION,
)
from mutator.triggers import trace_formulas
from mutator.triggers.conditions import TIME

_TIME_SLACK_S = 1e-9  # s; times are sums of steps


def first_actuator_change(
    golden: Trace, faulty: Trace, channels: Sequence[Channel], time_channel: str, t_manifest: float | None
) -> tuple[str, str] | None:
    """Return the compared channel that left golden at `t_manifest`, and where its faulty value was: `higher`,
    `lower`, or `no_number` (NaN). The first of `channels` if there are several.

    None without a manifestation, or if one of the runs ended, or if only the golden run has no number.
    """
    if t_manifest is None:
        return None
    for channel in channels:
        if channel_deviation(golden, faulty, channel, time_channel).t_first == t_manifest:
            values = values_at_common_time(golden, faulty, channel, time_channel, t_manifest)
            if values and (change := _direction_of_change(*values)):
                return channel.name, change
    return None


def _direction_of_change(golden: float, faulty: float) -> str | None:
    if math.isnan(faulty):
        return None if math.isnan(golden) else NO_NUMBER
    if faulty == golden or math.isnan(golden):
        return None
    return HIGHER if faulty > golden else LOWER


def share_in_direction(
    golden: Trace, faulty: Trace, time_channel: str, change: tuple[str, str] | None, end: float | None
) -> float | None:
    """Return which share, from 0 to 1, of a channel's deviation from golden has the direction of `change`: of
    the areas between both runs up to `end` (s; None: the end of the run). None if they enclose no area.
    """
    if change is None or change[1] == NO_NUMBER:
        return None
    times, differences = signed_differences(golden, faulty, change[0], time_channel)
    until = times <= (math.inf if end is None else end) + _TIME_SLACK_S
    areas = (differences[:-1] * np.diff(times))[until[1:]]
    areas = areas[np.isfinite(areas)]
    whole = math.fsum(np.abs(areas))  # exact, so it is the same on every machine
    same = math.fsum(np.abs(areas[areas > 0.0 if change[1] == HIGHER else areas < 0.0]))
    return same / whole if whole > 0.0 else None


def speeds_after_activation(
    manifest: TargetManifest,
    golden: Trace,
    faulty: Trace,
    activation: ObservedActivation | None,
    end: float | None,
) -> tuple[tuple[str, float], ...]:
    """Return the speed at the activation, and the highest and lowest speed of both runs from then to `end`
    (s; None: the end of the run), in m/s. Empty without an activation or without a speed in the manifest.
    """
    if activation is None or not manifest.speed:
        return ()
    last = (math.inf if end is None else end) + _TIME_SLACK_S
    first = activation.first - _TIME_SLACK_S
    speeds, golden_speeds = (_speeds_between(manifest, trace, first, last) for trace in (faulty, golden))
    named: list[tuple[str, float]] = []
    if speeds.size:
        named += [
            (SPEED_AT_ACTIVATION, float(speeds[0])),
            (HIGHEST_SPEED, float(speeds.max())),
            (LOWEST_SPEED, float(speeds.min())),
        ]
    if golden_speeds.size:
        named += [
            (GOLDEN_HIGHEST_SPEED, float(golden_speeds.max())),
            (GOLDEN_LOWEST_SPEED, float(golden_speeds.min())),
        ]
    return tuple(named)


def end_of_run(manifest: TargetManifest, trace: Trace) -> RunEnd:
    """Return the last step of a run."""
    speed = math.nan
    if manifest.speed:
        values = formula_values_by_name(manifest, trace)
        speed = float(trace_formulas.formula_at_each_step(manifest.speed, values)[-1])
    return RunEnd(t=float(trace[manifest.time_channel][-1]), speed=speed if math.isfinite(speed) else None)


def _speeds_between(manifest: TargetManifest, trace: Trace, first: float, last: float) -> np.ndarray:
    values = formula_values_by_name(manifest, trace)
    speeds = trace_formulas.formula_at_each_step(manifest.speed, values)
    between = (values[TIME] >= first) & (values[TIME] <= last)
    return np.asarray(speeds[between & np.isfinite(speeds)])
