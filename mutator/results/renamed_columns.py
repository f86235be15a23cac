"""Columns that earlier versions of mutator named otherwise."""

from collections.abc import Collection
from pathlib import Path

RENAMED_COLUMNS = {"fault_tolerant_time": "time_to_hazard"}  # today's name by the earlier one
_MOST_HEADER_BYTES = 1_000_000


def renamed_columns_in(csv_path: Path, current_names: Collection[str]) -> str:
    """Return the renamed columns that a results.csv still has by their earlier names; '' if there are none.

    `current_names` are the columns that this version writes: a metric can have an earlier name.
    """
    try:
        with csv_path.open("rb") as file:
            header = file.readline(_MOST_HEADER_BYTES).decode(errors="replace").strip().split(",")
    except FileNotFoundError:
        return ""
    return ", ".join(name for name in header if name in RENAMED_COLUMNS and name not in current_names)
