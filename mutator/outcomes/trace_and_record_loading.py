"""Loads the traces of runs, and the records that targets write."""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from mutator._common.bounded_reading import MOST_JSON_BYTES, read_bounded
from mutator._common.confined_files import path_below
from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator._common.hashing import digest
from mutator._common.resource_shortages import find_shortage
from mutator.errors import BadOutput, BadTrace, MutatorError
from mutator.outcomes import trace_files
from mutator.outcomes.trace_files import own_times
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

Trace = Mapping[str, np.ndarray]  # channel name -> a value for each step or for each of its own times
_LARGEST_TIME_S = sys.float_info.max  # JSON can have whole numbers that no float holds
_TIME_SLACK_S = 1e-9  # times are sums of steps, which round
_MEMORY_TRIAL_BYTES = 64 << 20  # if these can be had, mutator is not short of memory


def trace_digest(manifest: TargetManifest, out: Path) -> str:
    try:
        return digest(read_bounded(path_below(out, manifest.trace_file)))
    except OSError as err:
        _check_no_shortage(err)
        raise BadOutput("the run left no trace", where=path_below(out, manifest.trace_file)) from None


def load_trace(
    manifest: TargetManifest,
    out: Path,
    channels: Sequence[Channel] | None = None,
    optional: Sequence[Channel] = (),
) -> Trace:
    """Load channels (default: all) and times of the trace in `out`. Channels in `optional` can be missing."""
    path = path_below(out, manifest.trace_file)
    expected_file = f"an {path.suffix} file" if path.suffix in (".npz", ".mcap") else f"a {path.suffix} file"
    try:
        trace = trace_files.read_trace(path, manifest, channels, optional)
    except BadTrace as err:
        raise BadOutput(err.got, where=path, expected=err.expected) from None
    except KeyError as err:
        _check_importer_works(err, manifest, path)
        raise BadOutput(f"no channel {err}", where=path, expected="the manifest's channels") from None
    except MutatorError:
        raise
    except Exception as err:  # a run can write anything, so readers can fail in many ways
        _check_no_shortage(err)
        _check_importer_works(err, manifest, path)
        raise BadOutput(
            f"not a readable trace ({_error_text(err)})", where=path, expected=expected_file
        ) from None
    _check_arrays(trace, manifest, path)
    return trace


def _check_importer_works(err: Exception, manifest: TargetManifest, path: Path) -> None:
    """Raise BadAddition if an importer of another package failed: nobody knows whether the run did."""
    names = {name for channel in manifest.channels for name in (channel.name_in_trace, channel.times_channel)}
    is_missing_channel = (
        isinstance(err, KeyError) and err.args[:1] and err.args[0] in {manifest.time_channel, *names}
    )
    if (
        path.is_file()
        and not is_missing_channel
        and (failure := TRACE_IMPORTER_DOOR.other_package_error(path.suffix.removeprefix("."), err))
    ):
        raise failure from err


def _check_arrays(trace: Trace, manifest: TargetManifest, path: Path) -> None:
    times = {own_times(name) for name in trace}
    for name, values in trace.items():
        if values.dtype.kind not in "biuf":
            raise BadOutput(f"channel {name} is not numeric", where=path)
        expected = values if name in times else times_of(trace, name, manifest.time_channel)
        if values.ndim != 1 or values.shape != expected.shape:
            raise BadOutput("channels of different lengths", where=path, expected="one value per step")
    for name in (times & trace.keys()) | {manifest.time_channel}:
        values = trace[name].astype(float)
        if not (np.isfinite(values).all() and (np.diff(values) >= 0.0).all()):
            channel = name.removesuffix(own_times(""))
            raise BadOutput(
                f"times of {channel} that decrease or are missing", where=path, expected="s, in order"
            )


def times_of(trace: Trace, channel: str, time_channel: str) -> np.ndarray:
    """Return the times (s) of a channel's values: its own times, or else those of the steps."""
    return trace.get(own_times(channel), trace[time_channel])


def trace_until(trace: Trace, end: float, time_channel: str) -> Trace:
    shortened = {}
    for name, values in trace.items():
        times = values if name.endswith(own_times("")) else times_of(trace, name, time_channel)
        shortened[name] = values[times <= end]
    return shortened


def values_on_steps(trace: Trace, channel: str, steps: np.ndarray) -> np.ndarray:
    """Return a channel's value at each step.

    A channel with its own times keeps its newest value. Before its first value it is NaN.
    """
    own_times_of_channel = trace.get(own_times(channel))
    return (
        trace[channel]
        if own_times_of_channel is None
        else newest_values(own_times_of_channel, trace[channel], steps)
    )


def newest_values(times: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    return np.concatenate(([np.nan], values))[np.searchsorted(times, at + _TIME_SLACK_S, side="right")]


def values_at_other_steps(times: np.ndarray, values: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Return a run's values, one for each of its `times`, at the steps of another run (s).

    Steps that differ get the newest value. Before its first step and after its last one, it is NaN.
    """
    rows = min(len(times), len(steps))
    if np.array_equal(times[:rows], steps[:rows]):
        return np.concatenate((values[:rows], np.full(len(steps) - rows, np.nan)))
    return np.where(steps > times[-1] + _TIME_SLACK_S, np.nan, newest_values(times, values, steps))


def load_target_record(manifest: TargetManifest, out: Path) -> dict[str, Any]:
    """Load the record that the target wrote in `out`, or an empty one if the manifest names no record."""
    if manifest.record_file is None:
        return {"hazards": {}, "alerts": []}
    path = path_below(out, manifest.record_file)
    try:
        data = json.loads(read_bounded(path, MOST_JSON_BYTES))
    except (OSError, ValueError, RecursionError) as err:
        _check_no_shortage(err)
        raise BadOutput(
            f"not a readable record ({_error_text(err)})", where=path, expected="a JSON object"
        ) from None
    judges = any(hazard.is_in_record for hazard in manifest.hazard_rules)
    if not isinstance(data, dict) or not _has_event_times(data, needs_hazards=judges):
        expected = "{hazards: {NAME: time or null}, alerts: [{name: NAME, t: time}]}"
        raise BadOutput("no hazards and alerts with their times", where=path, expected=expected)
    return data


def _check_no_shortage(err: Exception) -> None:
    """Raise ResourceShortage if mutator itself ran out of memory or file handles, so the output can be
    valid.
    """
    if short := find_shortage(err):
        if isinstance(err, MemoryError):
            with suppress(MemoryError):
                bytes(_MEMORY_TRIAL_BYTES)
                return  # there is enough memory, so the trace claims an impossible size
        raise short from err


def _error_text(err: Exception) -> str:
    """Return the error's text without the path, which differs between runs."""
    return str(err.strerror if isinstance(err, OSError) and err.strerror else err)


def _has_event_times(record: dict[str, Any], *, needs_hazards: bool) -> bool:
    hazards, events = record.get("hazards", None if needs_hazards else {}), _alert_events(record)
    if not isinstance(hazards, dict) or not isinstance(events, list):
        return False
    times = [time for time in hazards.values() if time is not None]
    for event in events:
        if not isinstance(event, dict) or not isinstance(event.get("name"), str):
            return False
        times.append(event.get("t"))
    return all(type(time) in (int, float) and abs(time) <= _LARGEST_TIME_S for time in times)


def _alert_events(record: Mapping[str, Any]) -> Any:
    """Return all times at which alerts were raised or, if the record lacks them, the first of each alert."""
    return record.get("alert_events") or record.get("alerts") or []


def alert_times(record: Mapping[str, Any], names: Sequence[str]) -> list[tuple[str, float]]:
    return [(event["name"], event["t"]) for event in _alert_events(record) if event["name"] in names]


def with_golden_times(golden: Trace, faulty: Trace, time_channel: str) -> Trace:
    """Return the faulty trace with the golden time array if both are equal, which speeds up comparisons."""
    return (
        {**faulty, time_channel: golden[time_channel]}
        if np.array_equal(golden[time_channel], faulty[time_channel])
        else faulty
    )
