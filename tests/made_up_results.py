"""Tables of made-up or forged results."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from pyarrow import parquet

from mutator.results.csv_and_parquet_writers import (
    CsvTableWriter,
    ParquetTableWriter,
    TableColumn,
    csv_lines,
    parquet_batch,
)

_TYPES = {"text": str, "flag": int, "count": int, "number": float}


def write_results(run: Path, columns: Sequence[TableColumn], lines: Iterable[Mapping[str, object]]) -> None:
    """Write results.parquet and results.csv of a run folder. A missing or empty cell has no value."""
    cells = cells_of(columns, lines)
    with ParquetTableWriter(run / "results.parquet", columns) as file:
        file.append(parquet_batch(columns, cells))
    with CsvTableWriter(run / "results.csv", columns) as csv:
        csv.append(csv_lines(zip(*cells, strict=True)))


def cells_of(columns: Sequence[TableColumn], lines: Iterable[Mapping[str, object]]) -> list[list[object]]:
    """Return the typed cells of each column."""
    found = list(lines)
    texts = [[line.get(column.name, "") for line in found] for column in columns]
    return [
        [None if cell in ("", None) else _TYPES[column.type](cell) for cell in cells]  # type: ignore[call-overload]
        for column, cells in zip(columns, texts, strict=True)
    ]


def edit_results(run: Path, old: str, new: str) -> None:
    """Replace a part of the texts in both tables of a run folder."""
    csv, path = run / "results.csv", run / "results.parquet"
    head, lines = csv.read_text().split("\n", 1)
    csv.write_text(f"{head}\n{lines.replace(old, new)}")
    table = parquet.read_table(path)
    for at, field in enumerate(table.schema):
        if pa.types.is_string(field.type):
            cells = pc.replace_substring(table.column(at), old, new)
            table = table.set_column(at, field, cells)
    parquet.write_table(table, path)
