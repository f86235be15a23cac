"""The columns of another version in a results.csv."""

from pathlib import Path

from mutator.results.renamed_columns import renamed_columns_in


def test_only_a_column_that_is_no_longer_written_is_a_renamed_one(tmp_path: Path) -> None:
    """A metric may have the earlier name; a file that is missing or no text has no such column."""
    table = tmp_path / "results.csv"
    assert renamed_columns_in(table, ["time_to_hazard"]) == ""
    table.write_bytes(b"\xff,fault_tolerant_time,unknown\n1,2,3\n")
    assert renamed_columns_in(table, ["time_to_hazard"]) == "fault_tolerant_time"
    assert renamed_columns_in(table, ["time_to_hazard", "fault_tolerant_time"]) == ""
