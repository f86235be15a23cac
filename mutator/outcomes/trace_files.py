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
from mutator._common.extension_doors import TRACE_IMPORTER_DOOR
from mutator.errors import BadTrace
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

Arrays = dict[str, np.ndarray]
MOST_TRACE_BYTES = MOST_FILE_BYTES  # bytes of a trace, also when unpacked
MOST_COLUMNS = 10_000  # bounds the time that a file of tiny columns takes


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceRequest:
    """What to read from a file: `channels` and the step times, which are in `time_channel`.

    Channels in `optional` can be missing. With `everything`, also the names that are no channels.
    """

    path: Path
    time_channel: str
    channels: Sequence[Channel]
    optional: Sequence[Channel] = ()
    everything: bool = False

    def choose_names(self, available: Collection[str]) -> dict[str, None]:
        """Return the names to read from a file that has the `available` ones, and those that it must have."""
        if self.everything:
            return dict.fromkeys(available)
        of_time = [channel.times_channel for channel in self.channels if channel.times_channel]
        names = [self.time_channel, *of_time, *(channel.name_in_trace for channel in self.channels)]
        optional_names = {
            name for channel in self.optional for name in (channel.name_in_trace, channel.times_channel)
        }
        return {name: None for name in names if name in available or name not in optional_names}


@dataclass(frozen=True, slots=True, kw_only=True)
class Importer:
    """A reader of traces; its name is the suffix.

    `read` returns an array for each channel and for the step times, by manifest name; a channel that lacks
    values at some steps also has its times, named by `own_times`. BadTrace for an invalid file, KeyError
    for a missing channel. After any other exception, the experiment is a harness error, because nobody knows
    whether the run or the importer failed. A file can claim any size, so check before you unpack it.
    """

    about: str
    read: Callable[[TraceRequest], Arrays]


@cache
def _importer_for(name: str) -> Importer:
    importer = TRACE_IMPORTER_DOOR.load(name)
    assert isinstance(importer, Importer)
    return importer


def check_trace_size(size: int) -> None:
    """Raise BadTrace if a trace unpacks to too many bytes."""
    if size > MOST_TRACE_BYTES:
        raise BadTrace(f"{size:,} bytes when unpacked", f"at most {MOST_TRACE_BYTES:,}")


def own_times(name: str) -> str:
    """Return the name for the times of a channel that lacks values at some steps."""
    return f"{name}@"


def read_trace(
    path: Path, manifest: TargetManifest, channels: Iterable[Channel] | None, optional: Sequence[Channel] = ()
) -> Arrays:
    """Read the channels and step times of a trace, by manifest name. A channel that lacks values at some
    steps has its own times, named by `own_times`.

    Without `channels`, read everything, including names that are not in the manifest. Channels in `optional`
    can be missing. BadTrace for an invalid file, KeyError for any other missing channel. Other errors of the
    importer are not caught.
    """
    requested = manifest.channels if channels is None else (*channels, *optional)
    request = TraceRequest(
        path=path,
        time_channel=manifest.time_channel,
        channels=requested,
        optional=optional,
        everything=channels is None,
    )
    arrays = _importer_for(path.suffix.removeprefix(".")).read(request)
    needed = () if request.everything else [channel.name for channel in requested if channel not in optional]
    missing = {request.time_channel, *needed} - arrays.keys()
    if missing or not all(isinstance(array, np.ndarray) for array in arrays.values()):
        raise TypeError(f"no array for {', '.join(sorted(missing)) or 'some channels'}")
    return arrays


def by_channel(columns: Arrays, request: TraceRequest, *, has_empty_cells: bool = False) -> Arrays:
    """Return the columns of a file by manifest name, with the times of channels that have their own.

    With `has_empty_cells`, rows without a step time belong to channels with their own times.
    """
    channel_names = {c.name_in_trace for c in request.channels} | {
        c.times_channel for c in request.channels if c.times_channel
    }
    rest = {
        name: column for name, column in columns.items() if request.everything and name not in channel_names
    }
    time = columns[request.time_channel]
    steps = ~_empty_mask(time) if has_empty_cells else slice(None)
    values = {name: column[steps] for name, column in rest.items()} | {request.time_channel: time[steps]}
    for channel in request.channels:
        if channel.name_in_trace not in columns and (request.everything or channel in request.optional):
            continue
        column = columns[channel.name_in_trace]
        rows = steps
        if channel.times_channel:
            rows = ~_empty_mask(column) if has_empty_cells else slice(None)
            values[own_times(channel.name)] = columns[channel.times_channel][rows]
        values[channel.name] = column[rows]
    return values


def frame_columns(frame: Any, request: TraceRequest) -> Arrays:
    return {str(name): frame[name].to_numpy() for name in request.choose_names(frame.columns)}


def _empty_mask(values: np.ndarray) -> np.ndarray:
    return np.isnan(values) if values.dtype.kind == "f" else np.zeros(values.shape, dtype=bool)
