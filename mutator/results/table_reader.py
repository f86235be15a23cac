"""Reads a run's results as frames, rows, or bytes.

Only functions that return frames or rows import pandas.
"""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator._common.bounded_reading import MOST_EXPERIMENT_DATA_BYTES, read_bounded
from mutator.errors import MutatorError
from mutator.families.family_facts import FamilyFacts
from mutator.model import Experiment, Outcome, Status
from mutator.results import table_building
from mutator.results.csv_and_parquet_writers import TableColumn, parquet_batch, parquet_schema
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn
from mutator.results.plan_columns import FAMILY_COLUMN, PlanColumn
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_columns import cells_by_column, result_columns_of
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import load_head

if TYPE_CHECKING:
    import pandas as pd

_CATEGORY_COLUMNS = (
    "module",
    "fault_type",
    "reading",
    "unit",
    "scenario",
    "method",
    "trigger",
    "variant",
    "aim",
)
_ORDERED_VALUES_BY_COLUMN = {"status": [s.value for s in Status], "outcome": [o.value for o in Outcome]}
# Cells and bytes of text that a small Parquet file may claim, and how many more for each byte of a large one:
# equal values are stored once, so that a forged file could claim more than the memory holds.
MOST_SMALL_FILE_CELLS, MOST_SMALL_FILE_TEXT_BYTES = 10_000_000, 100_000_000
_MOST_CLAIMED_PER_BYTE = 20
# rows to compare at a time; bytes that other versions of pyarrow may add
_ROWS_COMPARED_AT_ONCE, _SPARE_BYTES = 1000, 100_000
_EXPERIMENTS_PER_BATCH = 2_000  # computed at a time; a million records as objects take 5 GB
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
        return cls(table_building.ensure_tables(run).parent)

    @property
    def path(self) -> Path:
        return self.run / table_building.PARQUET_FILE

    def csv(self) -> bytes:
        return self._read_file(table_building.CSV_FILE)

    def parquet(self) -> bytes:
        return self._read_file(table_building.PARQUET_FILE)

    def _read_file(self, name: str) -> bytes:
        try:
            return read_bounded(self.run / name, MOST_EXPERIMENT_DATA_BYTES)
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

    def row_count(self) -> int:
        return len(self.frame("experiment_id"))

    def rows(self) -> tuple[ResultRow, ...]:
        frame = self.frame()
        sentences = ExperimentSentences.of_run(load_head(self.run))
        return tuple(rows_of(frame, plan_file.load_faults(self.run), sentences))

    def frame(self, *names: str) -> "pd.DataFrame":
        """Return a frame with the types of results.parquet, of all columns or only those named. Without a
        value, texts are '' and numbers NaN. `attrs` has the target's `hazards` and the run's `families`.
        """
        data, folder = self.parquet(), RunFolder(self.run)
        columns = [column for column in result_columns_of(folder) if not names or column.name in names]
        head = folder.head
        return typed_frame(self._load_checked_columns(data, columns), head.hazards, head.families)

    def indexed_frame(self) -> "pd.DataFrame":
        """Return a frame of all columns for notebooks, indexed by experiment id.

        Names are categories; `outcome` and `status` are ordered. Flags are nullable booleans (NA: the run
        failed). Times are floats in simulated seconds (NaN: no such event). Added columns are `kind`
        (`sensor/bias`), `hazard` (any hazard) and `t_hazard` (the first one). `frame.attrs["units"]` has the
        unit of each number, and `frame.attrs["hazards"]` the target's hazards.
        """
        import pandas as pd

        data, folder = self.parquet(), RunFolder(self.run)
        head = folder.head
        columns, hazards = result_columns_of(folder), [name.lower() for name in head.hazards]
        frame: pd.DataFrame = _to_pandas(
            _without_dictionaries(self._load_checked_columns(data, columns))
        ).set_index("experiment_id")
        frame["kind"] = (frame["module"] + "/" + frame["fault_type"]).astype("category")
        for name in (column.name for column in columns if column.type == "flag"):
            frame[name] = frame[name].astype("boolean")
        for name in (*_CATEGORY_COLUMNS, *((FAMILY_COLUMN.name,) if head.families else ())):
            frame[name] = frame[name].astype("category")
        for name, order in _ORDERED_VALUES_BY_COLUMN.items():
            frame[name] = pd.Categorical(frame[name], categories=order, ordered=True)
        any_hazard = frame[hazards].any(axis=1).astype("boolean")
        says_nothing = (frame["status"] != Status.OK.value) | (frame["outcome"] == Outcome.NOT_JUDGED.value)
        frame["hazard"] = any_hazard.mask(says_nothing)
        frame["t_hazard"] = frame[[f"t_{name}" for name in hazards]].min(axis=1).astype(float)
        numbers = {
            column.name: column.unit or "-" for column in columns if column.type in ("count", "number")
        }
        frame.attrs |= {"hazards": head.hazards, "units": numbers | {"t_hazard": "s"}}
        return frame

    def _load_checked_columns(self, data: bytes, columns: Sequence[TableColumn]) -> Any:
        """Return these columns; MutatorError if one is missing, or has another type or impossible cells."""
        import pyarrow as pa  # type: ignore[import-untyped]
        from pyarrow import parquet

        source = io.BytesIO(data)
        try:
            schema = parquet.read_schema(source)
            for field in parquet_schema(columns):
                if schema.names.count(field.name) != 1:
                    raise self._not_a_table_error(f"no column '{field.name}'")
                if (column_type := schema.field(field.name).type) != field.type:
                    raise self._not_a_table_error(
                        f"column '{field.name}' has the type {column_type}, not {field.type}"
                    )
            table = _load_columns(source, [column.name for column in columns])
            self._check_cells(table, columns)
            return table
        except (pa.ArrowException, OSError) as err:
            raise self._not_a_table_error(str(err)) from None

    def _check_cells(self, table: Any, columns: Sequence[TableColumn]) -> None:
        """MutatorError for a cell that is not a status, an outcome or a flag."""
        for column in columns:
            name = column.name
            if column.type == "flag":
                allowed: set[object] = {0, 1, None}
            elif name in _ORDERED_VALUES_BY_COLUMN:
                allowed = {*_ORDERED_VALUES_BY_COLUMN[name], *([None] if name == "outcome" else [])}
            else:
                continue
            cells = {cell for part in table[name].chunks for cell in part.unique().to_pylist()}
            if unknown := sorted(map(repr, cells - allowed)):
                raise self._not_a_table_error(f"column '{name}' has the cell {unknown[0]}")

    def propagation(self) -> "pd.DataFrame":
        """Return a frame of propagation.parquet, with a row for each channel that left golden."""
        return _to_pandas(_without_dictionaries(_load_columns(io.BytesIO(self.propagation_parquet()))))

    def propagation_parquet(self) -> bytes:
        return self._read_file(table_building.PROPAGATION_FILE)

    def timings(self) -> "pd.DataFrame":
        """Return a frame of timings.parquet, with a row for each experiment that ran."""
        return _to_pandas(_without_dictionaries(_load_columns(io.BytesIO(self.timings_parquet()))))

    def timings_parquet(self) -> bytes:
        return self._read_file(table_building.TIMINGS_FILE)

    def _not_a_table_error(self, why: str) -> MutatorError:
        return MutatorError(f"not a results table: {why}", where=self.path, remedy=_REMEDY)


def frame_of_experiments(folder: RunFolder, experiments: Iterable[Experiment]) -> "pd.DataFrame":
    """Return the frame of the `experiments` with a record, computed from plan and records. It is as from
    `Results.frame`, but the columns of the fault's path are empty.
    """
    records, scale = folder.records(), folder.severity_scale
    finished = (
        FinishedExperiment(experiment, records[experiment.id], scale)
        for experiment in experiments
        if experiment.id in records
    )
    head = folder.head
    return frame_of_finished(result_columns_of(folder), finished, head.hazards, head.families)


def frame_of_finished(
    columns: Sequence[PlanColumn | ResultColumn],
    finished: Iterable[FinishedExperiment],
    hazards: Iterable[str],
    families: Iterable[FamilyFacts] = (),
) -> "pd.DataFrame":
    """Return the frame of experiments with their records, as from `Results.frame`."""
    import pyarrow as pa

    remaining = iter(finished)
    pieces = iter(lambda: list(islice(remaining, _EXPERIMENTS_PER_BATCH)), [])
    batches = [parquet_batch(columns, cells_by_column(columns, piece)) for piece in pieces]
    return typed_frame(pa.Table.from_batches(batches, parquet_schema(columns)), hazards, families)


def typed_frame(table: Any, hazards: Iterable[str], families: Iterable[FamilyFacts] = ()) -> "pd.DataFrame":
    """Return a frame of a table with the types of results.parquet, as from `Results.frame`."""
    import pandas as pd
    import pyarrow as pa

    columns = {}
    for name in table.column_names:  # one column at a time, to avoid two copies in memory
        column, table = _without_dictionaries(table.select([name])), table.drop_columns([name])
        if pa.types.is_string(column.schema.types[0]):
            column = pa.table([column[name].fill_null("")], [name])
        columns[name] = _to_pandas(column.combine_chunks())[name]
    frame = pd.DataFrame(columns)
    frame.attrs |= {"hazards": tuple(hazards), "families": tuple(families)}
    return frame


def _without_dictionaries(table: Any) -> Any:
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


def is_same_parquet(path: Path, other_path: Path) -> bool:
    """Return whether two Parquet files have the same rows and metadata.

    Different versions of pyarrow can write different bytes.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        files = [parquet.ParquetFile(file_path, pre_buffer=False) for file_path in (path, other_path)]
        first, second = (file.schema_arrow for file in files)
        sizes, other_sizes = (_row_groups(file.metadata) for file in files)
        return (
            first.equals(second, check_metadata=True)
            and [rows for rows, _ in sizes] == [rows for rows, _ in other_sizes]
            and all(a <= 2 * b + _SPARE_BYTES for (_, a), (_, b) in zip(sizes, other_sizes, strict=True))
            and all(_has_same_columns(files[0], files[1], group) for group in range(len(other_sizes)))
        )
    except (pa.ArrowException, OSError):
        return False


def _row_groups(metadata: Any) -> list[tuple[int, int]]:
    """Return the rows and the unpacked bytes of each part of a Parquet file."""
    groups = map(metadata.row_group, range(metadata.num_row_groups))
    return [(group.num_rows, group.total_byte_size) for group in groups]


def _has_same_columns(first: Any, second: Any, group: int) -> bool:
    """Compare a few rows of one column at a time: a text that is stored once can be in each row."""
    for name in first.schema_arrow.names:
        parts = (
            file.iter_batches(_ROWS_COMPARED_AT_ONCE, [group], [name], use_threads=False)
            for file in (first, second)
        )
        if not all(
            batch is not None and batch.equals(other_batch) for batch, other_batch in zip_longest(*parts)
        ):
            return False
    return True


def _load_columns(source: Path | io.BytesIO, names: Sequence[str] | None = None) -> Any:
    """Read columns of a Parquet file (None: all); each text is stored once. All is done in this thread:
    pyarrow aborts the process if its threads free memory at exit.
    """
    import pyarrow as pa
    from pyarrow import parquet

    schema = parquet.read_schema(source)
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    file = parquet.ParquetFile(source, read_dictionary=texts, pre_buffer=False)
    size = source.stat().st_size if isinstance(source, Path) else source.getbuffer().nbytes
    _check_claimed_size(
        file.metadata.num_rows * file.metadata.num_columns, "cells", size, MOST_SMALL_FILE_CELLS
    )
    _check_claimed_size(
        sum(unpacked for _, unpacked in _row_groups(file.metadata)), "bytes", size, MOST_SMALL_FILE_TEXT_BYTES
    )
    table = file.read(columns=names, use_threads=False)
    texts = [name for name in texts if name in table.column_names]
    _check_claimed_size(
        sum(_text_bytes(table[name]) for name in texts), "bytes of text", size, MOST_SMALL_FILE_TEXT_BYTES
    )
    return table


def _check_claimed_size(count: int, what: str, size: int, most: int) -> None:
    if count > most + _MOST_CLAIMED_PER_BYTE * size:
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
