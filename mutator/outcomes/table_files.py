"""Tables as files, written a batch of rows at a time: CSV for everyone, Parquet for programs."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from mutator.outcomes.columns import Column

_ROWS = 1 << 20  # of a row group, as pyarrow has it by itself; less where there are many columns:
_CELLS = 1 << 23  # of a row group, which is in memory as a whole
_TYPES = {"text": "string", "flag": "int8", "count": "int64", "number": "float64"}


class CsvTable:
    """A CSV file that begins with the names of its columns; None is an empty cell."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        self._file = path.open("w", encoding="utf-8", newline="")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerow([column.name for column in columns])

    def __enter__(self) -> "CsvTable":
        return self

    def append(self, rows: Iterable[Sequence[object]]) -> None:
        self._writer.writerows(rows)

    def __exit__(self, *error: object) -> None:
        self._file.close()


class ParquetTable:
    """A Parquet file; nothing in it depends on when or where it was made, or in which batches."""

    def __init__(self, path: Path, columns: Sequence[Column]) -> None:
        import pyarrow as pa  # type: ignore[import-untyped]
        from pyarrow import parquet

        self._pa = pa
        self._schema = pa.schema([(c.name, pa.type_for_alias(_TYPES[c.type])) for c in columns])
        self._writer = parquet.ParquetWriter(path, self._schema, compression="zstd")
        self._group = min(_ROWS, _CELLS // len(columns))
        self._held: list[Any] = []
        self._count = 0  # rows that are held
        self._is_empty = True

    def __enter__(self) -> "ParquetTable":
        return self

    def append(self, values: Sequence[Sequence[object]]) -> None:
        """Append rows, given as a sequence of values for each column."""
        arrays = [self._pa.array(some, field.type) for some, field in zip(values, self._schema, strict=True)]
        batch = self._pa.record_batch(arrays, schema=self._schema)
        self._held.append(batch)
        self._count += batch.num_rows
        while self._count >= self._group:
            self._write(self._group)

    def _write(self, count: int) -> None:
        """Write the first rows of those that are held as a group."""
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
