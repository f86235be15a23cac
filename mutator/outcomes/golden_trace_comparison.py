"""Compares the traces of faulty runs with those of their golden runs."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mutator.model import ObservedActivation
from mutator.outcomes.trace_and_record_loading import Trace, newest_values, times_of
from mutator.targets.channels import Channel

BACK_TO_GOLDEN_S = 2.0  # how long a run must be as golden to count as back
_TIME_SLACK_S = 1e-9  # times are sums of steps, which round


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceDifference:
    """How a trace differs from the golden trace."""

    t_first: float | None  # time (s) of the first difference beyond tolerance
    t_back: float | None  # time (s) of the last one, if the rest of the run is at least `BACK_TO_GOLDEN_S`
    max_dev: tuple[tuple[str, float], ...]  # largest difference of each compared channel in the whole run
    max_dev_in_drive: tuple[tuple[str, float], ...]  # the same up to the end of the drive


def compare_traces(
    golden: Trace, faulty: Trace, channels: Sequence[Channel], time_channel: str, t_end: float | None = None
) -> TraceDifference:
    """Compare channels value by value. NaN equals NaN.

    If one trace is shorter, the traces differ from its end onward; if their times differ, from the first
    different time onward. `t_end` is the end of the drive if that is before the end of the run.
    """
    end = np.inf if t_end is None else t_end + _TIME_SLACK_S
    first = first_time_only_in_longer(golden[time_channel], faulty[time_channel])
    last = -np.inf if first == np.inf else np.inf
    max_dev: list[tuple[str, float]] = []
    dev: list[tuple[str, float]] = []
    for channel in channels:
        channel_difference = channel_deviation(golden, faulty, channel, time_channel)
        first = min(first, channel_difference.t_first)
        last = max(last, channel_difference.t_last)
        max_dev.append((channel.name, channel_difference.largest()))
        dev.append((channel.name, channel_difference.largest(end)))
    times = faulty[time_channel]
    is_back = len(times) > 0 and -np.inf < last <= times[-1] - BACK_TO_GOLDEN_S + _TIME_SLACK_S
    return TraceDifference(
        t_first=None if first == np.inf else first,
        t_back=float(last) if is_back else None,
        max_dev=tuple(max_dev),
        max_dev_in_drive=tuple(dev),
    )


@dataclass(frozen=True, slots=True)
class ChannelDeviation:
    """The absolute difference |faulty - golden| of a channel at the times of both runs."""

    common_times: np.ndarray
    absolute_differences: np.ndarray
    t_first: float  # when it first exceeds the tolerance or the times differ; infinite if never
    t_last: float  # when it last exceeds the tolerance; -infinite if never, infinite if the times differ

    def largest(self, end: float = np.inf) -> float:
        return float(self.absolute_differences[self.common_times <= end].max(initial=0.0))


def channel_deviation(golden: Trace, faulty: Trace, channel: Channel, time_channel: str) -> ChannelDeviation:
    times = [times_of(trace, channel.name, time_channel) for trace in (golden, faulty)]
    values = [golden[channel.name], faulty[channel.name]]
    at, values = _values_at_common_times(times, values)
    differs = values[0] != values[1]
    begin = int(differs.argmax()) if differs.size else 0
    if not differs[begin : begin + 1].any():  # true of most channels
        unequal = _first_unequal_time(*times)
        return ChannelDeviation(at[:0], at[:0], unequal, -np.inf if unequal == np.inf else np.inf)
    at, values = at[begin:], [values_of_run[begin:] for values_of_run in values]
    differences = _absolute_difference(*values)
    beyond = np.flatnonzero(differences > channel.tolerance)
    first, last = (float(at[beyond[0]]), float(at[beyond[-1]])) if beyond.size else (np.inf, -np.inf)
    unequal = _first_unequal_time(*times)
    return ChannelDeviation(at, differences, min(first, unequal), last if unequal == np.inf else np.inf)


def values_at_common_time(
    golden: Trace, faulty: Trace, channel: Channel, time_channel: str, time: float
) -> tuple[float, float] | None:
    """Return the golden and the faulty value of a channel at this time; None if a run lacks this time."""
    times = [times_of(trace, channel.name, time_channel) for trace in (golden, faulty)]
    at, values = _values_at_common_times(times, [golden[channel.name], faulty[channel.name]])
    index = int(np.searchsorted(at, time))
    if index == len(at) or at[index] != time:
        return None
    return float(values[0][index]), float(values[1][index])


def signed_differences(
    golden: Trace, faulty: Trace, channel: str, time_channel: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return the times of both runs, and faulty - golden of a channel there; NaN without a number."""
    times = [times_of(trace, channel, time_channel) for trace in (golden, faulty)]
    at, values = _values_at_common_times(times, [golden[channel], faulty[channel]])
    with np.errstate(invalid="ignore", over="ignore"):
        return at, values[1].astype(float) - values[0].astype(float)


def _first_unequal_time(golden: np.ndarray, faulty: np.ndarray) -> float:
    """Return the time at which the times of two runs first differ or one run ends, or infinity."""
    if golden is faulty:
        return np.inf
    rows = min(len(golden), len(faulty))
    unlike = np.flatnonzero(golden[:rows] != faulty[:rows])
    if unlike.size:
        return float(min(golden[unlike[0]], faulty[unlike[0]]))
    return first_time_only_in_longer(golden, faulty)


def first_time_only_in_longer(golden: np.ndarray, faulty: np.ndarray) -> float:
    """Return the first time that only the longer run has, or infinity if both have equal length."""
    rows = min(len(golden), len(faulty))
    longer = max(golden, faulty, key=len)
    return float(longer[rows]) if rows < len(longer) else np.inf


def _values_at_common_times(
    times: list[np.ndarray], values: list[np.ndarray]
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return times and the values of both runs at these times.

    If the runs have different times, return the union of their times and each run's newest values.
    """
    if times[0] is times[1]:
        return times[0], values
    rows = min(map(len, times))
    if np.array_equal(times[0][:rows], times[1][:rows]):
        return times[0][:rows], [values_of_run[:rows] for values_of_run in values]
    at = np.union1d(*times)
    return at, [
        newest_values(times_of_run, values_of_run, at)
        for times_of_run, values_of_run in zip(times, values, strict=True)
    ]


def _absolute_difference(golden: np.ndarray, faulty: np.ndarray) -> np.ndarray:
    """Return |faulty - golden|; equal infinities and two NaNs differ by 0, NaN and a number by infinity."""
    golden, faulty = golden.astype(float), faulty.astype(float)
    same = (golden == faulty) | (np.isnan(golden) & np.isnan(faulty))
    with np.errstate(invalid="ignore", over="ignore"):
        difference = np.abs(faulty - golden)
    return np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference))


def reason_not_by_fault(t_first: float | None, activation: ObservedActivation | None) -> str:
    """Return why the fault cannot have caused a difference from the golden run; empty if it can."""
    if t_first is None or (activation is not None and t_first >= activation.first):
        return ""
    when = "although the fault was never active"
    if activation is not None:
        when = f"before the fault was first active ({activation.first} s)"
    return f"differs from the golden run at {t_first} s, {when}"
