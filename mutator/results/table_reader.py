"""Reads a run's results as frames, rows, or bytes.

Only functions that return frames or rows import pandas.
"""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator._common.bounded_reading import MOST_DATA_BYTES, read_bounded
from mutator.errors import MutatorError
from mutator.model import Experiment, Outcome, Status
from mutator.results import table_building
from mutator.results.result_rows import Row, rows_of
from mutator.results.table_columns import Finished, cells_of, columns_of
from mutator.results.table_files import Column, record_batch, schema_of
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import load_head

if TYPE_CHECKING:
    import pandas as pd

_NAMES = ("module", "fault_type", "reading", "unit", "scenario", "method", "trigger", "variant", "aim")
_SCALES = {"status": [s.value for s in Status], "outcome": [o.value for o in Outcome]}
MOST_CELLS, MOST_TEXT = 10_000_000, 100_000_000  # cells and bytes of text of a small Parquet file
_PACKED = 20  # further ones for each byte of a large file
_ROWS, _SPARE = 1000, 100_000  # rows to compare at a time; bytes that other versions of pyarrow may add
_BATCH = 2_000  # experiments computed at a time
_REMEDY = "rebuild it: `mutator report DIR`"


@dataclass(frozen=True, slots=True)
class Results:
    """The results table of the run folder `run`, as it was last built: its results.parquet, which all readers
    use, and its results.csv, which is only exported.

    Every access reads the files. MutatorError if a file is missing or not a results table.
    """

    run: Path

    @classmethod
    def up_to_date(cls, run: Path) -> "Results":
        """Return the table of a run folder, rebuilt if it is missing or older than the records."""
        return cls(table_building.ensure(run).parent)

    @property
    def path(self) -> Path:
        return self.run / table_building.PARQUET

    def csv(self) -> bytes:
        return self._read(table_building.CSV)

    def parquet(self) -> bytes:
        return self._read(table_building.PARQUET)

    def _read(self, name: str) -> bytes:
        try:
            return read_bounded(self.run / name, MOST_DATA_BYTES)
        except FileNotFoundError:
            raise MutatorError(
                f"no results here (no {name})",
                where=self.run,
                expected="a run folder, made by `mutator run`",
                remedy="correct the path, or build the results: `mutator report DIR`",
            ) from None
        except OSError as err:
            raise MutatorError(
                f"the results cannot be read ({err.strerror})", where=self.run / name
            ) from None

    def count(self) -> int:
        return len(self.frame("experiment_id"))

    def rows(self) -> tuple[Row, ...]:
        return tuple(rows_of(self.frame(), plan_file.load_faults(self.run)))

    def frame(self, *only: str) -> "pd.DataFrame":
        """Return a frame with the types of results.parquet, of all columns or only those named. Without a
        value, texts are '' and numbers NaN. `attrs["hazards"]` are the target's hazards.
        """
        data, head = self.parquet(), load_head(self.run)
        columns = [column for column in columns_of(head) if not only or column.name in only]
        return typed(self._table(data, columns), head.hazards)

    def indexed_frame(self) -> "pd.DataFrame":
        """Return a frame of all columns for notebooks, indexed by experiment id.

        Names are categories; `outcome` and `status` are ordered. Flags are nullable booleans (NA: the run
        failed). Times are floats in simulated seconds (NaN: no such event). Added columns are `kind`
        (`sensor/bias`), `hazard` (any hazard) and `t_hazard` (the first one). `frame.attrs["units"]` has the
        unit of each number, and `frame.attrs["hazards"]` the target's hazards.
        """
        import pandas as pd

        data, head = self.parquet(), load_head(self.run)
        columns, hazards = columns_of(head), [name.lower() for name in head.hazards]
        frame: pd.DataFrame = _to_pandas(_plain(self._table(data, columns))).set_index("experiment_id")
        frame["kind"] = (frame["module"] + "/" + frame["fault_type"]).astype("category")
        for name in (column.name for column in columns if column.type == "flag"):
            frame[name] = frame[name].astype("boolean")
        for name in _NAMES:
            frame[name] = frame[name].astype("category")
        for name, order in _SCALES.items():
            frame[name] = pd.Categorical(frame[name], categories=order, ordered=True)
        came = frame[hazards].any(axis=1).astype("boolean")
        frame["hazard"] = came.mask(frame["status"] != Status.OK.value)
        frame["t_hazard"] = frame[[f"t_{name}" for name in hazards]].min(axis=1).astype(float)
        numbers = {
            column.name: column.unit or "-" for column in columns if column.type in ("count", "number")
        }
        frame.attrs |= {"hazards": head.hazards, "units": numbers | {"t_hazard": "s"}}
        return frame

    def _table(self, data: bytes, columns: Sequence[Column]) -> Any:
        """Return these columns; MutatorError if one is missing, or has another type or impossible cells."""
        import pyarrow as pa  # type: ignore[import-untyped]
        from pyarrow import parquet

        source = io.BytesIO(data)
        try:
            schema = parquet.read_schema(source)
            for field in schema_of(columns):
                if schema.names.count(field.name) != 1:
                    raise self._no_table(f"no column '{field.name}'")
                if (found := schema.field(field.name).type) != field.type:
                    raise self._no_table(f"column '{field.name}' has the type {found}, not {field.type}")
            table = _table(source, [column.name for column in columns])
            self._check_cells(table, columns)
            return table
        except (pa.ArrowException, OSError) as err:
            raise self._no_table(str(err)) from None

    def _check_cells(self, table: Any, columns: Sequence[Column]) -> None:
        """MutatorError for a cell that is not a status, an outcome or a flag."""
        for column in columns:
            name = column.name
            if column.type == "flag":
                known: set[object] = {0, 1, None}
            elif name in _SCALES:
                known = {*_SCALES[name], *([None] if name == "outcome" else [])}
            else:
                continue
            cells = {cell for part in table[name].chunks for cell in part.unique().to_pylist()}
            if unknown := sorted(map(repr, cells - known)):
                raise self._no_table(f"column '{name}' has the cell {unknown[0]}")

    def propagation(self) -> "pd.DataFrame":
        """Return a frame of propagation.parquet, with a row for each channel that left golden."""
        return _to_pandas(_plain(_table(io.BytesIO(self.propagation_parquet()))))

    def propagation_parquet(self) -> bytes:
        return self._read(table_building.PROPAGATION)

    def timings(self) -> "pd.DataFrame":
        """Return a frame of timings.parquet, with a row for each experiment that ran."""
        return _to_pandas(_plain(_table(io.BytesIO(self.timings_parquet()))))

    def timings_parquet(self) -> bytes:
        return self._read(table_building.TIMINGS_PARQUET)

    def _no_table(self, why: str) -> MutatorError:
        return MutatorError(f"not a results table: {why}", where=self.path, remedy=_REMEDY)


def frame_of(folder: RunFolder, experiments: Iterable[Experiment]) -> "pd.DataFrame":
    """Return the frame of the `experiments` with a record, computed from plan and records. It is as from
    `Results.frame`, but the columns of the fault's path are empty.
    """
    import pyarrow as pa

    columns, records, scale = columns_of(folder.head), folder.records(), folder.severity_scale
    finished = (Finished(one, records[one.id], scale) for one in experiments if one.id in records)
    pieces = iter(lambda: list(islice(finished, _BATCH)), [])
    batches = [record_batch(columns, cells_of(columns, piece)) for piece in pieces]
    return typed(pa.Table.from_batches(batches, schema_of(columns)), folder.head.hazards)


def typed(table: Any, hazards: Iterable[str]) -> "pd.DataFrame":
    """Return a frame of a table with the types of results.parquet, as from `Results.frame`."""
    import pandas as pd
    import pyarrow as pa

    columns = {}
    for name in table.column_names:  # one column at a time, to avoid two copies in memory
        column, table = _plain(table.select([name])), table.drop_columns([name])
        if pa.types.is_string(column.schema.types[0]):
            column = pa.table([column[name].fill_null("")], [name])
        columns[name] = _to_pandas(column.combine_chunks())[name]
    frame = pd.DataFrame(columns)
    frame.attrs["hazards"] = tuple(hazards)
    return frame


def _plain(table: Any) -> Any:
    """Return a table with each text in its row, instead of the number of a text that is stored once."""
    import pyarrow as pa

    fields = [
        field.with_type(pa.string()) if pa.types.is_dictionary(field.type) else field
        for field in table.schema
    ]
    return table.cast(pa.schema(fields))


def _to_pandas(table: Any) -> "pd.DataFrame":
    # a run's tables have no metadata; in a forged one, it could give columns each other's names
    frame: pd.DataFrame = table.to_pandas(use_threads=False, ignore_metadata=True)
    return frame


def same_parquet(path: Path, made: Path) -> bool:
    """Return whether two Parquet files have the same rows and metadata.

    Different versions of pyarrow can write different bytes.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        files = [parquet.ParquetFile(one, pre_buffer=False) for one in (path, made)]
        first, second = (file.schema_arrow for file in files)
        sizes, wanted = (_row_groups(file.metadata) for file in files)
        return (
            first.equals(second, check_metadata=True)
            and [rows for rows, _ in sizes] == [rows for rows, _ in wanted]
            and all(a <= 2 * b + _SPARE for (_, a), (_, b) in zip(sizes, wanted, strict=True))
            and all(_same_columns(files[0], files[1], group) for group in range(len(wanted)))
        )
    except (pa.ArrowException, OSError):
        return False


def _row_groups(metadata: Any) -> list[tuple[int, int]]:
    """Return the rows and the unpacked bytes of each part of a Parquet file."""
    groups = map(metadata.row_group, range(metadata.num_row_groups))
    return [(group.num_rows, group.total_byte_size) for group in groups]


def _same_columns(first: Any, second: Any, group: int) -> bool:
    """Compare a few rows of one column at a time: a text that is stored once can be in each row."""
    for name in first.schema_arrow.names:
        parts = (file.iter_batches(_ROWS, [group], [name], use_threads=False) for file in (first, second))
        if not all(one is not None and one.equals(other) for one, other in zip_longest(*parts)):
            return False
    return True


def _table(source: Path | io.BytesIO, names: Sequence[str] | None = None) -> Any:
    """Read columns of a Parquet file (None: all); each text is stored once. All is done in this thread:
    pyarrow aborts the process if its threads free memory at exit.
    """
    import pyarrow as pa
    from pyarrow import parquet

    schema = parquet.read_schema(source)
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    file = parquet.ParquetFile(source, read_dictionary=texts, pre_buffer=False)
    size = source.stat().st_size if isinstance(source, Path) else source.getbuffer().nbytes
    _check_claim(file.metadata.num_rows * file.metadata.num_columns, "cells", size, MOST_CELLS)
    _check_claim(sum(unpacked for _, unpacked in _row_groups(file.metadata)), "bytes", size, MOST_TEXT)
    table = file.read(columns=names, use_threads=False)
    texts = [name for name in texts if name in table.column_names]
    _check_claim(sum(_text_bytes(table[name]) for name in texts), "bytes of text", size, MOST_TEXT)
    return table


def _check_claim(count: int, what: str, size: int, most: int) -> None:
    if count > most + _PACKED * size:
        raise MutatorError(
            f"a results table of {size:,} bytes that claims {count:,} {what}",
            expected="the table that the run wrote",
            remedy=_REMEDY,
        )


def _text_bytes(column: Any) -> int:
    """Return the bytes of a column in which each text is stored once."""
    import pyarrow.compute as pc  # type: ignore[import-untyped]

    lengths = (pc.binary_length(part.dictionary).take(part.indices) for part in column.chunks)
    return sum(pc.sum(pc.cast(part, "int64")).as_py() or 0 for part in lengths)
