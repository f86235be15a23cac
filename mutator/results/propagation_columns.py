"""The columns of propagation.parquet: the channels that left golden in each run."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mutator.model import Record
from mutator.results.table_files import Column
from mutator.targets.target_facts import ChannelFacts

COLUMNS = (
    Column("experiment_id", "text", "", "the experiment"),
    Column("channel", "text", "", "a channel that differed from the golden run by more than its tolerance"),
    Column("component", "text", "", "the component of the channel, from the manifest"),
    Column("role", "text", "", "`actuator`, `truth` or `internal`"),
    Column("t_first", "number", "s", "when the channel first left golden"),
    Column("max_dev", "number", "as its channel", "the largest difference from golden up to the drive's end"),
)


def columns_of(records: Iterable[Record], channels: Sequence[ChannelFacts]) -> Mapping[str, list[Any]]:
    """Return the columns of propagation.parquet, which has a row for each channel that left golden."""
    facts = {channel.name: (channel.component, channel.role.value) for channel in channels}
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
