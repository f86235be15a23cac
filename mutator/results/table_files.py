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

_ROWS = 1 << 20  # maximum number of rows in a row group (pyarrow's default)
_CELLS = 1 << 23  # maximum number of cells in a row group, because a whole group is in memory

ColumnType = Literal["text", "flag", "count", "number"]
ARROW_TYPES = {"text": "string", "flag": "int8", "count": "int64", "number": "double"}


@dataclass(frozen=True, slots=True)
class Column:
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


def record_batch(columns: Sequence[Column], values: Sequence[Sequence[object]]) -> Any:
    """Return Parquet rows, given the values of each column."""
    import pyarrow as pa  # type: ignore[import-untyped]

    schema = schema_of(columns)
    arrays = [pa.array(some, field.type) for some, field in zip(values, schema, strict=True)]
    return pa.record_batch(arrays, schema=schema)


def schema_of(columns: Sequence[Column]) -> Any:
    """Return the Parquet schema of columns."""
    import pyarrow as pa

    return pa.schema([(c.name, pa.type_for_alias(ARROW_TYPES[c.type])) for c in columns])


class CsvTable:
    """A CSV file that begins with its column names."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        self._file = path.open("wb")
        self.append(csv_lines([[column.name for column in columns]]))

    def __enter__(self) -> "CsvTable":
        return self

    def append(self, lines: bytes) -> None:
        self._file.write(lines)

    def __exit__(self, *error: object) -> None:
        self._file.close()


class ParquetTable:
    """A Parquet file. Equal rows give equal bytes, regardless of the batches."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        import pyarrow as pa
        from pyarrow import parquet

        self._pa = pa
        self._schema = schema_of(columns)
        self._writer = parquet.ParquetWriter(path, self._schema, compression="zstd")
        self._group = min(_ROWS, _CELLS // len(columns))
        self._held: list[Any] = []
        self._count = 0  # number of rows not yet written
        self._is_empty = True

    def __enter__(self) -> "ParquetTable":
        return self

    def append(self, batch: Any) -> None:
        self._held.append(batch)
        self._count += batch.num_rows
        while self._count >= self._group:
            self._write(self._group)

    def _write(self, count: int) -> None:
        held = self._pa.Table.from_batches(self._held, self._schema)
        self._writer.write_table(held.slice(0, count).combine_chunks(), self._group)
        self._held = held.slice(count).to_batches()
        self._count -= count
        self._is_empty = False

    def __exit__(
        self, kind: type[BaseException] | None, *error: BaseException | TracebackType | None
    ) -> None:
        if kind is None and (self._count or self._is_empty):
            self._write(self._count)
        self._writer.close()
