"""Golden runs and how a faulty run differs from them."""

import json
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mutator._common.files import no_pipe
from mutator._common.hashing import digest
from mutator._common.shortages import shortage
from mutator.errors import MutatorError
from mutator.targets.manifest import Channel, TargetManifest

Trace = Mapping[str, np.ndarray]  # channel name -> one value per step


_LARGEST = sys.float_info.max
_TRIAL = 64 << 20  # bytes


class BadOutput(MutatorError):
    """A run ended well but did not leave the trace or record that the manifest promises."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Where a trace leaves golden: time of the first difference beyond tolerance (s), and the largest
    difference of each compared channel."""

    t_first: float | None
    max_dev: tuple[tuple[str, float], ...]


def trace_digest(manifest: TargetManifest, out: Path) -> str:
    """Digest of the trace file's bytes."""
    try:
        return digest(no_pipe(out / manifest.trace_file).read_bytes())
    except OSError as err:
        _check_is_of_output(err)
        raise BadOutput("the run left no trace", where=out / manifest.trace_file) from None


def load_trace(manifest: TargetManifest, out: Path, channels: Sequence[str] | None = None) -> Trace:
    """Channels (default: all) and time of the trace in the output folder `out`."""
    path = out / manifest.trace_file
    try:
        loaded = np.load(no_pipe(path), allow_pickle=False)
        if not isinstance(loaded, np.lib.npyio.NpzFile):
            raise BadOutput("an array alone", where=path, expected="an .npz file")
        with loaded as file:
            names = file.files if channels is None else [manifest.time_channel, *channels]
            trace = {name: np.asarray(file[name]) for name in names}
    except KeyError as err:
        raise BadOutput(f"no channel {err}", where=path, expected="the manifest's channels") from None
    except MutatorError:
        raise
    except Exception as err:  # a run may write anything, and numpy fails at it in any way
        _check_is_of_output(err)
        raise BadOutput(f"not a readable trace ({_why(err)})", where=path, expected="an .npz file") from None
    shapes = {values.shape for values in trace.values()}
    if any(len(shape) != 1 for shape in shapes) or len(shapes) > 1:
        raise BadOutput("channels of different lengths", where=path, expected="one value per step")
    if words := [name for name, values in trace.items() if values.dtype.kind not in "biuf"]:
        raise BadOutput(f"channel {words[0]} of something else than numbers", where=path)
    return trace


def load_record(manifest: TargetManifest, out: Path) -> dict[str, Any]:
    """What the target itself said about a run in `out`: hazards, alerts, and more."""
    path = out / manifest.record_file
    try:
        data = json.loads(no_pipe(path).read_bytes())
    except (OSError, ValueError, RecursionError) as err:
        _check_is_of_output(err)
        raise BadOutput(
            f"not a readable record ({_why(err)})", where=path, expected="a JSON object"
        ) from None
    if not isinstance(data, dict) or not _has_times(data):
        expected = "{hazards: {NAME: time or null}, alerts: [{name: NAME, t: time}]}"
        raise BadOutput("no hazards and alerts with their times", where=path, expected=expected)
    return data


def _check_is_of_output(err: Exception) -> None:
    """Shortage where an output could not be read for want of memory or files here: not the run's doing."""
    if short := shortage(err):
        if isinstance(err, MemoryError):
            with suppress(MemoryError):
                bytes(_TRIAL)
                return  # there is plenty: a trace that says that it is larger than memory
        raise short from err


def _why(err: Exception) -> str:
    """The error without the path in it, which differs from run to run."""
    return str(err.strerror if isinstance(err, OSError) and err.strerror else err)


def _has_times(record: dict[str, Any]) -> bool:
    hazards, events = record.get("hazards"), _events(record)
    if not isinstance(hazards, dict) or not isinstance(events, list):
        return False
    times = [time for time in hazards.values() if time is not None]
    for event in events:
        if not isinstance(event, dict) or not isinstance(event.get("name"), str):
            return False
        times.append(event.get("t"))
    return all(type(time) in (int, float) and abs(time) <= _LARGEST for time in times)


def _events(record: Mapping[str, Any]) -> Any:
    """Every raise of an alert, or its first ones, whichever the record has."""
    return record.get("alert_events") or record.get("alerts") or []


def hazards_of(record: Mapping[str, Any], counted: Sequence[str]) -> list[tuple[str, float]]:
    """(hazard, first time) of those that occurred, of the hazards that count."""
    hazards = record["hazards"].items()
    return [(name, time) for name, time in hazards if time is not None and name in counted]


def alerts_of(record: Mapping[str, Any], counted: Sequence[str]) -> list[tuple[str, float]]:
    """(alert, time) of every raise that the record knows, of the alerts that count."""
    return [(event["name"], event["t"]) for event in _events(record) if event["name"] in counted]


def compare(golden: Trace, faulty: Trace, channels: Sequence[Channel], time: str) -> Difference:
    """Compare the channels row by row; NaN equals NaN; a trace of another length differs where one ends."""
    rows = min(len(golden[time]), len(faulty[time]))
    longer = max(golden[time], faulty[time], key=len)
    first = rows if rows < len(longer) else None
    largest: list[tuple[str, float]] = []
    for channel in channels:
        deviation = _deviation(golden[channel.name][:rows], faulty[channel.name][:rows])
        largest.append((channel.name, float(deviation.max(initial=0.0))))
        beyond = np.flatnonzero(deviation > channel.tolerance)
        if beyond.size and (first is None or beyond[0] < first):
            first = int(beyond[0])
    return Difference(t_first=None if first is None else float(longer[first]), max_dev=tuple(largest))


def _deviation(golden: np.ndarray, faulty: np.ndarray) -> np.ndarray:
    """|faulty - golden|, 0 where both are the same number, infinity or NaN; infinite where one is none."""
    golden, faulty = golden.astype(float), faulty.astype(float)
    same = (golden == faulty) | (np.isnan(golden) & np.isnan(faulty))
    with np.errstate(invalid="ignore", over="ignore"):
        difference = np.abs(faulty - golden)
    return np.where(same, 0.0, np.where(np.isnan(difference), np.inf, difference))
