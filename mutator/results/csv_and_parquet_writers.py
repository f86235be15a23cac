"""What a column of a table is, and files of tables, written in batches of rows: CSV for people, Parquet for
programs.
"""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal

_MOST_ROW_GROUP_ROWS = 1 << 20  # maximum number of rows in a row group (pyarrow's default)
_MOST_ROW_GROUP_CELLS = 1 << 23  # maximum number of cells in a row group, because a whole group is in memory

ColumnType = Literal["text", "flag", "count", "number"]
ARROW_TYPE_BY_COLUMN_TYPE = {"text": "string", "flag": "int8", "count": "int64", "number": "double"}


@dataclass(frozen=True, slots=True)
class TableColumn:
    """A column of a table. A `flag` is 0 or 1."""

    name: str
    type: ColumnType
    unit: str
    about: str


def csv_lines(rows: Iterable[Sequence[object]]) -> bytes:
    """Write rows as CSV lines. None becomes an empty cell."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue().encode()


def parquet_batch(columns: Sequence[TableColumn], values: Sequence[Sequence[object]]) -> Any:
    """Return Parquet rows, given the values of each column."""
    import pyarrow as pa  # type: ignore[import-untyped]

    schema = parquet_schema(columns)
    arrays = [
        pa.array(column_values, field.type) for column_values, field in zip(values, schema, strict=True)
    ]
    return pa.record_batch(arrays, schema=schema)


def parquet_schema(columns: Sequence[TableColumn]) -> Any:
    """Return the Parquet schema of columns."""
    import pyarrow as pa

    return pa.schema([(c.name, pa.type_for_alias(ARROW_TYPE_BY_COLUMN_TYPE[c.type])) for c in columns])


class CsvTableWriter:
    """A CSV file that begins with its column names."""

    def __init__(self, path: Path, columns: Sequence[TableColumn]) -> None:
        self._file = path.open("wb")
        self.append(csv_lines([[column.name for column in columns]]))

    def __enter__(self) -> "CsvTableWriter":
        return self

    def append(self, lines: bytes) -> None:
        self._file.write(lines)

    def __exit__(self, *error: object) -> None:
        self._file.close()


class ParquetTableWriter:
    """A Parquet file. Equal rows give equal bytes, regardless of the batches."""

    def __init__(self, path: Path, columns: Sequence[TableColumn]) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        self._pa = pa
        self._schema = parquet_schema(columns)
        self._writer = parquet.ParquetWriter(path, self._schema, compression="zstd")
        self._rows_per_group = min(_MOST_ROW_GROUP_ROWS, _MOST_ROW_GROUP_CELLS // len(columns))
        self._pending_batches: list[Any] = []
        self._pending_rows = 0  # number of rows not yet written
        self._is_empty = True

    def __enter__(self) -> "ParquetTableWriter":
        return self

    def append(self, batch: Any) -> None:
        self._pending_batches.append(batch)
        self._pending_rows += batch.num_rows
        while self._pending_rows >= self._rows_per_group:
            self._write_rows(self._rows_per_group)

    def _write_rows(self, count: int) -> None:
        pending = self._pa.Table.from_batches(self._pending_batches, self._schema)
        self._writer.write_table(pending.slice(0, count).combine_chunks(), self._rows_per_group)
        self._pending_batches = pending.slice(count).to_batches()
        self._pending_rows -= count
        self._is_empty = False

    def __exit__(
        self, kind: type[BaseException] | None, *error: BaseException | TracebackType | None
    ) -> None:
        if kind is None and (self._pending_rows or self._is_empty):
            self._write_rows(self._pending_rows)
        self._writer.close()
