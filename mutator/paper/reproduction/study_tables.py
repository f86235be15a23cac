"""The tables of the study: CSV files of which pages are rendered. Cells are text, as in the files."""

import csv
import io
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import make_folder, write_atomic
from mutator._common.hashing import digest
from mutator.errors import MutatorError
from mutator.statistics.tallies import Tally

Row = Mapping[str, str]
COUNTS = (
    "injected",
    "activated",
    "manifested",
    "hazards",
    "alerts",
    "hazards_no_alerts",
    "alerts_no_hazards",
)
HEADS: Mapping[str, tuple[str, ...]] = {
    "runs": (
        *(
            "campaign",
            "title",
            "commit",
            "tables_commit",
            "experiments",
            "plan",
            "seal",
            "results_digest",
            "python",
            "mutator",
        ),
        "packages",
    ),
    "fault_types": ("campaign", "method", "fault_type", *COUNTS),
    "scenarios": ("campaign", "method", "scenario", *COUNTS),
    "alerts": ("campaign", "method", "scenario", "alert", "runs"),
    "alerts_by_fault_type": ("campaign", "scenario", "fault_type", "activated", "alerts"),
    "fault_free": ("campaign", "seed", "scenario", "changes", "hazards", "alerts"),
    "explaining_counts": ("campaign", "what", "count"),
    "agreement": ("campaign", "fault_types", "correlation", "low", "high", "tied_here", "tied_in_paper"),
    "claims": (
        *("campaign", "observation", "observation_verdict", "claim", "says", "needed", "group", "estimate"),
        *("rule", "verdict", "claim_verdict", "change"),
    ),
    "observations": ("campaign", "observation", "title", "verdict", "on_paper", "change"),
    "observations_by_seed": ("campaign", "seed", "observation", "verdict", "change"),
    "seeds": ("campaign", "share", "all_seeds", "between_seeds", "least", "largest"),
    "data_set": ("file", "bytes", "sha256"),
}
MOST_BYTES = 300_000  # of all tables, which are committed
_MOST_NAMED = 3
_RUNS_FILE = "runs.csv"


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyTables:
    """All tables by name."""

    rows_by_name: Mapping[str, Sequence[Row]]

    def rows(self, name: str, **cells: str) -> list[Row]:
        """Return the rows of a table that have these cells."""
        return [
            row for row in self.rows_by_name[name] if all(row[key] == value for key, value in cells.items())
        ]

    def of_campaign(self, name: str) -> Mapping[str, Sequence[Row]]:
        """Return the rows of a campaign by table, without those about the data set."""
        return {
            table: [row for row in rows if row.get("campaign") == name]
            for table, rows in self.rows_by_name.items()
        }

    def without_campaigns(self, names: Collection[str]) -> "StudyTables":
        """Return all rows but those of these campaigns and those about the data set."""
        return StudyTables(
            rows_by_name={
                table: [row for row in rows if "campaign" in row and row["campaign"] not in names]
                for table, rows in self.rows_by_name.items()
            }
        )

    def file_bytes(self) -> dict[str, bytes]:
        """Return the files by name."""
        files = {}
        for name, heads in HEADS.items():
            out = io.StringIO()
            writer = csv.DictWriter(out, heads, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows_by_name[name])
            files[f"{name}.csv"] = out.getvalue().encode()
        return files

    def digest(self) -> str:
        """Return the digest of the tables, which the page names."""
        return digest({name: digest(data) for name, data in self.file_bytes().items()})

    def write(self, folder: Path) -> None:
        """Write the files. MutatorError if they are too large to be committed."""
        files = self.file_bytes()
        if (size := sum(map(len, files.values()))) > MOST_BYTES:
            raise MutatorError(f"tables of {size:,} bytes", where=folder, expected=f"at most {MOST_BYTES:,}")
        make_folder(folder)
        # it says which commit and campaigns the others are of: without it, none of them counts
        (folder / _RUNS_FILE).unlink(missing_ok=True)
        for name in sorted(files, key=lambda name: name == _RUNS_FILE):
            write_atomic(folder / name, files[name])

    def different_tables(self, other: "StudyTables") -> list[str]:
        """Return the files that differ from those of other tables."""
        mine, others = self.file_bytes(), other.file_bytes()
        return [name for name, data in mine.items() if others[name] != data]


def load_tables(folder: Path) -> StudyTables:
    """Read the tables of a folder. MutatorError if one is missing, or not as the study writes it."""
    rows_by_name = {}
    for name, heads in HEADS.items():
        path = folder / f"{name}.csv"
        try:
            text = read_bounded(path).decode()
        except (OSError, UnicodeDecodeError):
            raise MutatorError(
                "no table of the study here",
                where=path,
                expected="what `python -m mutator.paper.reproduce --out DIR` writes",
                remedy="drive the study, or restore the file with git",
            ) from None
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
        if any(tuple(row) != heads or None in row.values() for row in rows):
            raise MutatorError(
                "not a table of the study",
                where=path,
                expected=f"the columns {', '.join(heads[:_MOST_NAMED])} and so on",
                remedy="restore the file with git",
            )
        rows_by_name[name] = rows
    tables = StudyTables(rows_by_name=rows_by_name)
    for name, data in tables.file_bytes().items():
        if read_bounded(folder / name) != data:
            raise MutatorError(
                "not as the study writes it", where=folder / name, remedy="restore the file with git"
            )
    return tables


def tally_cells(tally: Tally) -> dict[str, str]:
    return {name: "" if (count := getattr(tally, name)) is None else str(count) for name in COUNTS}


def tally_of_row(row: Row) -> Tally:
    """Return the counts of a row. MutatorError if one is not a number."""
    try:
        return Tally(**{name: int(row[name]) if row[name] else None for name in COUNTS})  # type: ignore[arg-type]
    except ValueError as err:
        raise MutatorError(f"{err} in a table of the study", remedy="restore the tables with git") from None


def combined(parts: Iterable[Mapping[str, Sequence[Row]]]) -> StudyTables:
    """Return the tables whose parts have the rows of single campaigns."""
    rows: dict[str, list[Row]] = {name: [] for name in HEADS}
    for part in parts:
        for name, part_rows in part.items():
            rows[name] += part_rows
    return StudyTables(rows_by_name=rows)
