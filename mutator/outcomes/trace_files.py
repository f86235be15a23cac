"""Read the trace files of runs. The suffix selects the importer.

An importer is a module in `importers/`, or comes from another package (entry points of the group
`mutator.importers`).
"""

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mutator._common.bounded_reading import MOST_FILE_BYTES
from mutator._common.doors import IMPORTERS
from mutator.errors import BadTrace
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

Arrays = dict[str, np.ndarray]
MOST_TRACE = MOST_FILE_BYTES  # bytes of a trace, also when unpacked
MOST_COLUMNS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceRequest:
    """What to read from a file: `channels` and the step times, which are in the channel `time`.

    Channels in `also` can be missing. With `everything`, also the names that are no channels.
    """

    path: Path
    time: str
    channels: Sequence[Channel]
    also: Sequence[Channel] = ()
    everything: bool = False

    def choose(self, there: Collection[str]) -> dict[str, None]:
        """Return the names to read from a file that contains `there`, and those that it must not lack."""
        if self.everything:
            return dict.fromkeys(there)
        of_time = [channel.time for channel in self.channels if channel.time]
        names = [self.time, *of_time, *(channel.in_trace for channel in self.channels)]
        may_miss = {name for channel in self.also for name in (channel.in_trace, channel.time)}
        return {name: None for name in names if name in there or name not in may_miss}


@dataclass(frozen=True, slots=True, kw_only=True)
class Importer:
    """A reader of traces; its name is the suffix.

    `read` returns an array for each channel and for the step times, by manifest name; a channel that lacks
    values at some steps also has its times, named by `own_times`. BadTrace for an invalid file, KeyError for
    a missing channel. After any other exception, the experiment is a harness error, because nobody knows
    whether the run or the importer failed. A file can claim any size, so check before you unpack it.
    """

    about: str
    read: Callable[[TraceRequest], Arrays]


@cache
def _importer(name: str) -> Importer:
    found = IMPORTERS.load(name)
    assert isinstance(found, Importer)
    return found


def check_size(size: int) -> None:
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
    importer are not caught.
    """
    wanted = manifest.channels if channels is None else (*channels, *also)
    request = TraceRequest(
        path=path,
        time=manifest.time_channel,
        channels=wanted,
        also=also,
        everything=channels is None,
    )
    arrays = _importer(path.suffix.removeprefix(".")).read(request)
    needed = () if request.everything else [channel.name for channel in wanted if channel not in also]
    lacking = {request.time, *needed} - arrays.keys()
    if lacking or not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise TypeError(f"no array for {', '.join(sorted(lacking)) or 'some channels'}")
    return arrays


def by_channel(columns: Arrays, request: TraceRequest, *, has_empty_cells: bool = False) -> Arrays:
    """Return the columns of a file by manifest name, with the times of channels that have their own.

    With `has_empty_cells`, rows without a step time belong to channels with their own times.
    """
    known = {c.in_trace for c in request.channels} | {c.time for c in request.channels if c.time}
    rest = {name: column for name, column in columns.items() if request.everything and name not in known}
    time = columns[request.time]
    steps = ~_empty(time) if has_empty_cells else slice(None)
    values = {name: column[steps] for name, column in rest.items()} | {request.time: time[steps]}
    for channel in request.channels:
        if channel.in_trace not in columns and (request.everything or channel in request.also):
            continue
        column = columns[channel.in_trace]
        there = steps
        if channel.time:
            there = ~_empty(column) if has_empty_cells else slice(None)
            values[own_times(channel.name)] = columns[channel.time][there]
        values[channel.name] = column[there]
    return values


def frame_columns(frame: Any, request: TraceRequest) -> Arrays:
    return {str(name): frame[name].to_numpy() for name in request.choose(frame.columns)}


def _empty(values: np.ndarray) -> np.ndarray:
    return np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, dtype=bool)
