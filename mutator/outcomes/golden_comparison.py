"""Loads golden runs and compares faulty runs with them."""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mutator._common.bounded_reading import MOST_JSON_BYTES, read_bounded
from mutator._common.confined_files import path_below
from mutator._common.doors import IMPORTERS
from mutator._common.hashing import digest
from mutator._common.resource_shortages import find_shortage
from mutator.errors import BadOutput, BadTrace, MutatorError
from mutator.outcomes import trace_files
from mutator.outcomes.trace_files import own_times
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

Trace = Mapping[str, np.ndarray]  # channel name -> a value for each step or for each of its own times


_LARGEST = sys.float_info.max
_TRIAL = 64 << 20  # bytes
_TINY = 1e-9  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """How a trace differs from the golden trace."""

    t_first: float | None  # time (s) of the first difference beyond tolerance
    max_dev: tuple[tuple[str, float], ...]  # largest difference of each compared channel in the whole run
    dev: tuple[tuple[str, float], ...]  # the same up to the end of the drive


def trace_digest(manifest: TargetManifest, out: Path) -> str:
    try:
        return digest(read_bounded(path_below(out, manifest.trace_file)))
    except OSError as err:
        _check_is_of_output(err)
        raise BadOutput("the run left no trace", where=path_below(out, manifest.trace_file)) from None


def load_trace(
    manifest: TargetManifest,
    out: Path,
    channels: Sequence[Channel] | None = None,
    also: Sequence[Channel] = (),
) -> Trace:
    """Load channels (default: all) and times of the trace in `out`. Channels in `also` can be missing."""
    path = path_below(out, manifest.trace_file)
    kind = f"an {path.suffix} file" if path.suffix in (".npz", ".mcap") else f"a {path.suffix} file"
    try:
        trace = trace_files.read(path, manifest, channels, also)
    except BadTrace as err:
        raise BadOutput(err.got, where=path, expected=err.expected) from None
    except KeyError as err:
        _check_is_of_run(err, manifest, path)
        raise BadOutput(f"no channel {err}", where=path, expected="the manifest's channels") from None
    except MutatorError:
        raise
    except Exception as err:  # a run can write anything, so readers can fail in many ways
        _check_is_of_output(err)
        _check_is_of_run(err, manifest, path)
        raise BadOutput(f"not a readable trace ({_why(err)})", where=path, expected=kind) from None
    _check_arrays(trace, manifest, path)
    return trace


def _check_is_of_run(err: Exception, manifest: TargetManifest, path: Path) -> None:
    """Raise BadAddition if an importer of another package failed: nobody knows whether the run did."""
    names = {name for one in manifest.channels for name in (one.in_trace, one.time)}
    lacks = isinstance(err, KeyError) and err.args[:1] and err.args[0] in {manifest.time_channel, *names}
    if (
        path.is_file()
        and not lacks
        and (failure := IMPORTERS.addition_error(path.suffix.removeprefix("."), err))
    ):
        raise failure from err


def _check_arrays(trace: Trace, manifest: TargetManifest, path: Path) -> None:
    times = {own_times(name) for name in trace}
    for name, values in trace.items():
        if values.dtype.kind not in "biuf":
            raise BadOutput(f"channel {name} is not numeric", where=path)
        wanted = values if name in times else times_of(trace, name, manifest.time_channel)
        if values.ndim != 1 or values.shape != wanted.shape:
            raise BadOutput("channels of different lengths", where=path, expected="one value per step")
    for name in (times & trace.keys()) | {manifest.time_channel}:
        values = trace[name].astype(float)
        if not (np.isfinite(values).all() and (np.diff(values) >= 0.0).all()):
            channel = name.removesuffix(own_times(""))
            raise BadOutput(
                f"times of {channel} that decrease or are missing", where=path, expected="s, in order"
            )


def times_of(trace: Trace, channel: str, time: str) -> np.ndarray:
    """Return the times (s) of a channel's values: its own times, or else those of the steps."""
    return trace.get(own_times(channel), trace[time])


def until(trace: Trace, end: float, time: str) -> Trace:
    cut = {}
    for name, values in trace.items():
        times = values if name.endswith(own_times("")) else times_of(trace, name, time)
        cut[name] = values[times <= end]
    return cut


def on_steps(trace: Trace, channel: str, steps: np.ndarray) -> np.ndarray:
    """Return a channel's value at each step.

    A channel with its own times keeps its newest value. Before its first value it is NaN.
    """
    own = trace.get(own_times(channel))
    return trace[channel] if own is None else _newest(own, trace[channel], steps)


def _newest(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    return np.concatenate(([np.nan], values))[np.searchsorted(times, at + _TINY, side="right")]


def at_steps_of_other(times: np.ndarray, values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return a run's values, one for each of its `times`, at the steps of another run (s).

    Steps that differ get the newest value. Before its first step and after its last one, it is NaN.
    """
    rows = min(len(times), len(steps))
    if np.array_equal(times[:rows], steps[:rows]):
        return np.concatenate((values[:rows], np.full(len(steps) - rows, np.nan)))
    return np.where(steps > times[-1] + _TINY, np.nan, _newest(times, values, steps))


def load_record(manifest: TargetManifest, out: Path) -> dict[str, Any]:
    """Load the record that the target wrote in `out`, or an empty one if the manifest names no record."""
    if manifest.record_file is None:
        return {"hazards": {}, "alerts": []}
    path = path_below(out, manifest.record_file)
    try:
        data = json.loads(read_bounded(path, MOST_JSON_BYTES))
    except (OSError, ValueError, RecursionError) as err:
        _check_is_of_output(err)
        raise BadOutput(
            f"not a readable record ({_why(err)})", where=path, expected="a JSON object"
        ) from None
    judges = any(hazard.recorded for hazard in manifest.rules)
    if not isinstance(data, dict) or not _has_times(data, judges=judges):
        expected = "{hazards: {NAME: time or null}, alerts: [{name: NAME, t: time}]}"
        raise BadOutput("no hazards and alerts with their times", where=path, expected=expected)
    return data


def _check_is_of_output(err: Exception) -> None:
    """Raise Shortage if mutator itself ran out of memory or file handles, so the output can be valid."""
    if short := find_shortage(err):
        if isinstance(err, MemoryError):
            with suppress(MemoryError):
                bytes(_TRIAL)
                return  # there is enough memory, so the trace claims an impossible size
        raise short from err


def _why(err: Exception) -> str:
    """Return the error's text without the path, which differs between runs."""
    return str(err.strerror if isinstance(err, OSError) and err.strerror else err)


def _has_times(record: dict[str, Any], *, judges: bool) -> bool:
    hazards, events = record.get("hazards", None if judges else {}), _events(record)
    if not isinstance(hazards, dict) or not isinstance(events, list):
        return False
    times = [time for time in hazards.values() if time is not None]
    for event in events:
        if not isinstance(event, dict) or not isinstance(event.get("name"), str):
            return False
        times.append(event.get("t"))
    return all(type(time) in (int, float) and abs(time) <= _LARGEST for time in times)


def _events(record: Mapping[str, Any]) -> Any:
    """Return all times at which alerts were raised or, if the record lacks them, the first of each alert."""
    return record.get("alert_events") or record.get("alerts") or []


def alerts_of(record: Mapping[str, Any], counted: Sequence[str]) -> list[tuple[str, float]]:
    return [(event["name"], event["t"]) for event in _events(record) if event["name"] in counted]


def sharing_times(golden: Trace, faulty: Trace, time: str) -> Trace:
    """Return the faulty trace with the golden time array if both are equal, which speeds up comparisons."""
    return {**faulty, time: golden[time]} if np.array_equal(golden[time], faulty[time]) else faulty


def compare(
    golden: Trace, faulty: Trace, channels: Sequence[Channel], time: str, t_end: float | None = None
) -> Difference:
    """Compare channels value by value. NaN equals NaN.

    If one trace is shorter, the traces differ from its end onward; if their times differ, from the first
    different time onward. `t_end` is the end of the drive if that is before the end of the run.
    """
    end = np.inf if t_end is None else t_end + _TINY
    first = end_of_shorter(golden[time], faulty[time])
    largest: list[tuple[str, float]] = []
    driven: list[tuple[str, float]] = []
    for channel in channels:
        found = deviation(golden, faulty, channel, time)
        first = min(first, found.t_first)
        largest.append((channel.name, found.largest()))
        driven.append((channel.name, found.largest(end)))
    t_first = None if first == np.inf else first
    return Difference(t_first=t_first, max_dev=tuple(largest), dev=tuple(driven))


@dataclass(frozen=True, slots=True)
class Deviation:
    """The absolute difference |faulty - golden| of a channel at the times of both runs."""

    at: np.ndarray
    values: np.ndarray
    t_first: float  # when it first exceeds the tolerance or the times differ; infinite if never

    def largest(self, end: float = np.inf) -> float:
        return float(self.values[self.at <= end].max(initial=0.0))


def deviation(golden: Trace, faulty: Trace, channel: Channel, time: str) -> Deviation:
    times = [times_of(trace, channel.name, time) for trace in (golden, faulty)]
    values = [golden[channel.name], faulty[channel.name]]
    at, values = _on_same_times(times, values)
    apart = values[0] != values[1]
    begin = int(apart.argmax()) if apart.size else 0
    if not apart[begin : begin + 1].any():  # true of most channels
        return Deviation(at[:0], at[:0], _other_times(*times))
    at, values = at[begin:], [one[begin:] for one in values]
    values_apart = _deviation(*values)
    beyond = np.flatnonzero(values_apart > channel.tolerance)
    first = float(at[beyond[0]]) if beyond.size else np.inf
    return Deviation(at, values_apart, min(first, _other_times(*times)))


def _other_times(golden: np.ndarray, faulty: np.ndarray) -> float:
    """Return the time at which the times of two runs first differ or one run ends, or infinity."""
    if golden is faulty:
        return np.inf
    rows = min(len(golden), len(faulty))
    unlike = np.flatnonzero(golden[:rows] != faulty[:rows])
    if unlike.size:
        return float(min(golden[unlike[0]], faulty[unlike[0]]))
    return end_of_shorter(golden, faulty)


def end_of_shorter(golden: np.ndarray, faulty: np.ndarray) -> float:
    """Return the first time that only the longer run has, or infinity if both have equal length."""
    rows = min(len(golden), len(faulty))
    longer = max(golden, faulty, key=len)
    return float(longer[rows]) if rows < len(longer) else np.inf


def _on_same_times(times: list[np.ndarray], values: list[np.ndarray]) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return times and the values of both runs at these times.

    If the runs have different times, return the union of their times and each run's newest values.
    """
    if times[0] is times[1]:
        return times[0], values
    rows = min(map(len, times))
    if np.array_equal(times[0][:rows], times[1][:rows]):
        return times[0][:rows], [one[:rows] for one in values]
    at = np.union1d(*times)
    return at, [_newest(own, one, at) for own, one in zip(times, values, strict=True)]


def _deviation(golden: np.ndarray, faulty: np.ndarray) -> np.ndarray:
    """Return |faulty - golden|; equal infinities and two NaNs differ by 0, NaN and a number by infinity."""
    golden, faulty = golden.astype(float), faulty.astype(float)
    same = (golden == faulty) | (np.isnan(golden) & np.isnan(faulty))
    with np.errstate(invalid="ignore", over="ignore"):
        difference = np.abs(faulty - golden)
    return np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference))
