"""The columns of propagation.parquet: the channels that left golden in each run."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mutator.model import Record
from mutator.results.csv_and_parquet_writers import TableColumn
from mutator.targets.stored_target_facts import ChannelFacts

PROPAGATION_COLUMNS = (
    TableColumn("experiment_id", "text", "", "the experiment"),
    TableColumn(
        "channel", "text", "", "a channel that differed from the golden run by more than its tolerance"
    ),
    TableColumn("component", "text", "", "the component of the channel, from the manifest"),
    TableColumn("role", "text", "", "`actuator`, `truth` or `internal`"),
    TableColumn("t_first", "number", "s", "when the channel first left golden"),
    TableColumn(
        "max_dev", "number", "as its channel", "the largest difference from golden up to the drive's end"
    ),
)


def propagation_cells(records: Iterable[Record], channels: Sequence[ChannelFacts]) -> Mapping[str, list[Any]]:
    """Return the columns of propagation.parquet, which has a row for each channel that left golden."""
    facts = {channel.name: (channel.component, channel.role.value) for channel in channels}
    cells_by_column: dict[str, list[Any]] = {column.name: [] for column in PROPAGATION_COLUMNS}
    for record in records:
        if record.left:
            names, firsts, largest = zip(*record.left, strict=True)
            cells_by_column["experiment_id"] += [record.experiment_id] * len(names)
            cells_by_column["channel"] += names
            cells_by_column["t_first"] += firsts
            cells_by_column["max_dev"] += largest
    channel_facts = [facts.get(name, ("", "")) for name in cells_by_column["channel"]]
    cells_by_column["component"] = [component for component, _ in channel_facts]
    cells_by_column["role"] = [role for _, role in channel_facts]
    cells_by_column["t_first"] = [round(first, 6) for first in cells_by_column["t_first"]]
    return cells_by_column
