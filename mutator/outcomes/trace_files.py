"""Reads the trace files of runs. The suffix selects the reader."""

import io
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mutator._common.bounded import MOST_WHOLE, read_bounded
from mutator.errors import BadTrace
from mutator.outcomes import npz
from mutator.outcomes.mcap_files import read_topics
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

Arrays = dict[str, np.ndarray]
MOST_TRACE = MOST_WHOLE  # bytes of a trace, also when unpacked
MOST_CSV = 64_000_000  # bytes; as numbers, text takes more memory
_MOST_COLUMNS = 10_000
_NUMERIC = ("BOOLEAN", "INT32", "INT64", "FLOAT", "DOUBLE")


def _check_size(size: int) -> None:
    """Raise BadTrace if a trace unpacks to too many bytes."""
    if size > MOST_TRACE:
        raise BadTrace(f"{size:,} bytes when unpacked", f"at most {MOST_TRACE:,}")


def own_times(name: str) -> str:
    """Return the name for the times of a channel that lacks values at some steps."""
    return f"{name}@"


def read(
    path: Path, manifest: TargetManifest, channels: Iterable[Channel] | None, also: Sequence[Channel] = ()
) -> Arrays:
    """Read the channels and step times of a trace, by manifest name. A channel that lacks values at some
    steps has its own times, named by `own_times`.

    Without `channels`, read everything, including names that are not in the manifest. Channels in `also` can
    be missing. BadTrace for an invalid file, KeyError for any other missing channel. Other errors of the
    reader are not caught.
    """
    wanted = manifest.channels if channels is None else (*channels, *also)
    if path.suffix == ".mcap":
        return _read_mcap(path, manifest.time_channel, wanted, also)
    of_time = [channel.time for channel in wanted if channel.time]
    names = [manifest.time_channel, *of_time, *(channel.in_trace for channel in wanted)]
    may_miss = {name for channel in also for name in (channel.in_trace, channel.time)}
    columns = _COLUMNS[path.suffix](path, None if channels is None else names, may_miss)
    known = {channel.in_trace for channel in wanted} | {*of_time}
    rest = {name: column for name, column in columns.items() if channels is None and name not in known}
    time = columns[manifest.time_channel]
    # table rows without a step time belong to channels with their own times
    steps = slice(None) if path.suffix == ".npz" else ~_empty(time)
    values = {name: column[steps] for name, column in rest.items()} | {manifest.time_channel: time[steps]}
    for channel in wanted:
        if channel.in_trace not in columns and (channels is None or channel in also):
            continue
        column = columns[channel.in_trace]
        there = steps
        if channel.time:
            there = slice(None) if path.suffix == ".npz" else ~_empty(column)
            values[own_times(channel.name)] = columns[channel.time][there]
        values[channel.name] = column[there]
    return values


def _empty(values: np.ndarray) -> np.ndarray:
    return np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, dtype=bool)


def _read_npz(path: Path, names: Iterable[str] | None, may_miss: Collection[str]) -> Arrays:
    data = read_bounded(path, MOST_TRACE)
    members = npz.members(data)
    if members is not None:
        return {name: members[name] for name in _wanted(members, names, may_miss)}
    if data.startswith(npz.ARRAY):
        raise BadTrace("a single array", "an .npz file")
    if data.count(npz.ENTRY) > _MOST_COLUMNS:
        raise BadTrace(f"{data.count(npz.ENTRY)} members", f"at most {_MOST_COLUMNS}")
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        _check_size(sum(member.file_size for member in file.zip.infolist()))
        return {name: np.asarray(file[name]) for name in _wanted(file.files, names, may_miss)}


def _read_csv(path: Path, names: Iterable[str] | None, may_miss: Collection[str]) -> Arrays:
    import pandas as pd

    data = read_bounded(path, MOST_CSV)
    commas = data.count(b",", 0, data.find(b"\n") + 1 or None)
    if commas >= _MOST_COLUMNS:
        raise BadTrace(f"{commas + 1} columns", f"at most {_MOST_COLUMNS}")
    return _columns(pd.read_csv(io.BytesIO(data)), names, may_miss)


def _read_parquet(path: Path, names: Iterable[str] | None, may_miss: Collection[str]) -> Arrays:
    import pandas as pd
    from pyarrow import parquet  # type: ignore[import-untyped]

    data = read_bounded(path, MOST_TRACE)
    file = parquet.ParquetFile(io.BytesIO(data), pre_buffer=False)
    wanted = list(_wanted(file.schema_arrow.names, names, may_miss))
    _check_size(file.metadata.num_rows * min(len(wanted), file.metadata.num_columns) * 8)
    for column in file.schema:
        if column.name in wanted and column.physical_type not in _NUMERIC:
            raise BadTrace(f"channel {column.name} is not numeric", "a number in each row")
    return _columns(pd.read_parquet(io.BytesIO(data), columns=wanted), names, may_miss)


def _columns(frame: Any, names: Iterable[str] | None, may_miss: Collection[str]) -> Arrays:
    return {str(name): frame[name].to_numpy() for name in _wanted(frame.columns, names, may_miss)}


def _wanted(
    there: Collection[str], names: Iterable[str] | None, may_miss: Collection[str]
) -> dict[str, None]:
    """Return the names to read from a file that contains `there`: `names`, or all if None."""
    if names is None:
        return dict.fromkeys(there)
    return {name: None for name in names if name in there or name not in may_miss}


_COLUMNS: Mapping[str, Callable[[Path, Iterable[str] | None, Collection[str]], Arrays]] = {
    ".npz": _read_npz,
    ".csv": _read_csv,
    ".parquet": _read_parquet,
}


def _read_mcap(path: Path, steps: str, channels: Iterable[Channel], also: Sequence[Channel]) -> Arrays:
    """Read JSON messages. Channels are named `/topic:field.of.field`. Log times are simulated time in ns."""
    places = {channel.name: channel.in_trace.partition(":")[::2] for channel in channels}
    may_miss = {channel.name for channel in also}
    fields: dict[str, dict[str, None]] = {steps: {}}
    for topic, field in places.values():
        fields.setdefault(topic, {})[field] = None
    topics = read_topics(path, fields)
    if not topics[steps][0]:
        raise KeyError(steps)
    values = {steps: np.array(topics[steps][0])}
    for name, (topic, field) in places.items():
        times, columns = topics[topic]
        if not times:
            if name in may_miss:
                continue
            raise KeyError(topic)
        values[name] = np.array(columns[field])
        if topic != steps:
            values[own_times(name)] = np.array(times)
    return values
