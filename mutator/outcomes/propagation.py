"""Finds the channels that left golden in a run, with the first time and largest deviation of each."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from mutator.model import Record
from mutator.outcomes.columns import Column
from mutator.outcomes.golden import Trace, deviation, end_of_shorter
from mutator.targets.channels import Channel
from mutator.targets.manifest import TargetManifest

Departure = tuple[str, float, float]  # channel, first time (s), largest deviation

_TINY = 1e-9  # s; times are sums of steps
COLUMNS = (
    Column("experiment_id", "text", "", "the experiment"),
    Column("channel", "text", "", "a channel that differed from the golden run by more than its tolerance"),
    Column("component", "text", "", "the component of the channel, from the manifest"),
    Column("role", "text", "", "`actuator`, `truth` or `internal`"),
    Column("t_first", "number", "s", "when the channel first left golden"),
    Column("max_dev", "number", "the channel's", "the largest difference from golden up to the drive's end"),
)


def departures(
    golden: Trace, faulty: Trace, channels: Sequence[Channel], time: str, t_end: float | None
) -> tuple[Departure, ...]:
    """Return the `channels` that left golden before the end of the drive.

    Channels that are not recorded in both runs are skipped. If one run ends earlier, all channels leave
    golden at its end at the latest. The largest deviation is taken over the time that both runs cover.
    """
    end = np.inf if t_end is None else t_end + _TINY
    ended = end_of_shorter(golden[time], faulty[time])
    found = []
    for channel in channels:
        if channel.name in golden and channel.name in faulty:
            one = deviation(golden, faulty, channel, time)
            first = min(one.t_first, ended)
            if first <= end and first < np.inf:
                found.append((channel.name, first, one.largest(end)))
    return tuple(found)


def channel_facts(manifest: TargetManifest) -> list[list[str]]:
    return [[c.name, c.unit, c.role.value, c.component, c.about] for c in manifest.channels]


def columns_of(records: Iterable[Record], channels: Sequence[Sequence[str]]) -> Mapping[str, list[Any]]:
    """Return the columns of propagation.parquet, which has a row for each channel that left golden."""
    facts = {name: (component, role) for name, _, role, component, _ in channels}
    made: dict[str, list[Any]] = {column.name: [] for column in COLUMNS}
    for record in records:
        if record.left:
            names, firsts, largest = zip(*record.left, strict=True)
            made["experiment_id"] += [record.experiment_id] * len(names)
            made["channel"] += names
            made["t_first"] += firsts
            made["max_dev"] += largest
    found = [facts.get(name, ("", "")) for name in made["channel"]]
    made["component"] = [component for component, _ in found]
    made["role"] = [role for _, role in found]
    made["t_first"] = [round(first, 6) for first in made["t_first"]]
    return made
