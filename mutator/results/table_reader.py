"""Reads a run's results as rows, pandas frames, or bytes.

Only functions that return frames import pandas.
"""

import csv
import io
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from mutator._common.bounded import MOST_DATA, check_open, open_regular, read_bounded
from mutator.errors import MutatorError
from mutator.model import Experiment, Outcome, Record, Status
from mutator.results import table_building, table_cells
from mutator.results.column_facts import SINCE, hazard_columns
from mutator.results.rows import Row, row_from
from mutator.store.run_head import Head, read_head
from mutator.targets.severity import Scale

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import pandas as pd

_NEEDED = (
    "experiment_id",
    "fault_id",
    "module",
    "fault_type",
    "scenario",
    "method",
    "trigger",
    "seed",
    "status",
    "t_activation",
    "t_manifest",
    "t_alert",
)
_NAMES = ("module", "fault_type", "reading", "unit", "scenario", "method", "trigger", "variant", "aim")
_SCALES = {"status": [s.value for s in Status], "outcome": [o.value for o in Outcome]}
MOST_CELLS, MOST_TEXT = 10_000_000, 100_000_000  # cells and bytes of text of a small Parquet file
_PACKED = 20  # further ones for each byte of a large file
_ROWS, _SPARE = 1000, 100_000  # rows to compare at a time; bytes that other versions of pyarrow may add
_REMEDY = "rebuild it: `mutator report DIR`"


@dataclass(frozen=True, slots=True)
class Results:
    """A results table: the results.csv at `path`, and the results.parquet and run.json next to it.

    Every access reads the files. MutatorError if a file is missing or not a results table.
    """

    path: Path

    @classmethod
    def of_run(cls, run: Path) -> "Results":
        """Return the table of a run folder as it was last built."""
        return cls(run / table_building.CSV)

    @classmethod
    def up_to_date(cls, run: Path) -> "Results":
        """Return the table of a run folder, rebuilt if it is missing or older than the records."""
        return cls(table_building.ensure(run))

    def csv(self) -> bytes:
        return self._read(self.path)

    def parquet(self) -> bytes:
        return self._read(self.path.with_name(table_building.PARQUET))

    def _read(self, path: Path) -> bytes:
        try:
            return read_bounded(path, MOST_DATA)
        except FileNotFoundError:
            raise MutatorError(
                f"no results here (no {path.name})",
                where=path.parent,
                expected="a run folder, made by `mutator run`",
                remedy="correct the path, or build the results: `mutator report DIR`",
            ) from None
        except OSError as err:
            raise MutatorError(f"the results cannot be read ({err.strerror})", where=path) from None

    def lines(self) -> Iterator[dict[str, str]]:
        reader = csv.DictReader(io.TextIOWrapper(io.BytesIO(self.csv()), encoding="utf-8", newline=""))
        try:
            self._check_header(reader.fieldnames or ())
            for line in reader:
                if None in line or None in line.values():
                    raise self._no_table(f"line {reader.line_num} does not have as many cells as the header")
                yield line
        except (ValueError, csv.Error) as err:
            raise self._no_table(str(err)) from None

    def count(self) -> int:
        return len(self.texts())

    def rows(self) -> tuple[Row, ...]:
        try:
            lines = list(self.lines())
            hazards = self._hazards(lines[0]) if lines else ()
            return tuple(row_from(line, hazards) for line in lines)
        except (KeyError, TypeError, ValueError) as err:
            raise self._no_table(str(err)) from None

    def texts(self) -> "pd.DataFrame":
        """Return a frame of the cells as text ('' if empty); its `attrs["hazards"]` are the target's."""
        import pandas as pd
        import pyarrow as pa  # type: ignore[import-untyped]
        from pyarrow import csv as arrow_csv

        try:
            with self._opened() as file:
                names = next(csv.reader(io.TextIOWrapper(file, encoding="utf-8", newline="")), [])
            self._check_header(names)
            with self._opened() as file:
                table = arrow_csv.read_csv(
                    file,
                    arrow_csv.ReadOptions(use_threads=False),  # for the reason given in `_table`
                    arrow_csv.ParseOptions(newlines_in_values=True),
                    arrow_csv.ConvertOptions(column_types=dict.fromkeys(names, pa.string())),
                )
        except ValueError as err:
            raise self._no_table(str(err)) from None
        columns = {}
        for name in names:  # one column at a time, to avoid two copies in memory
            columns[name] = table.select([name]).combine_chunks().to_pandas(use_threads=False)[name]
            table = table.drop_columns([name])
        texts = pd.DataFrame(columns)
        texts.attrs["hazards"] = self._hazards(names)
        return texts

    def _opened(self) -> BinaryIO:
        try:
            file = open_regular(self.path)
            check_open(file, self.path)
            return file
        except OSError:
            self._read(self.path)  # raises the precise error
            raise

    def frame(self) -> "pd.DataFrame":
        """Return a frame of all columns, typed and indexed by experiment id.

        Names are categories; `outcome` and `status` are ordered. Flags are nullable booleans (NA: the run
        failed). Times are floats in simulated seconds (NaN: no such event). Added columns are `kind`
        (`sensor/bias`), `hazard` (any hazard) and `t_hazard` (the first one). `frame.attrs["units"]` has the
        unit of each number, and `frame.attrs["hazards"]` the target's hazards.
        """
        import pandas as pd

        frame = _frame(self.parquet()).set_index("experiment_id")
        frame.attrs["hazards"] = self._hazards(frame.columns)
        hazards = [name.lower() for name in frame.attrs["hazards"]]
        frame["kind"] = (frame["module"] + "/" + frame["fault_type"]).astype("category")
        for name in ("activated", "manifested", *hazards):
            frame[name] = frame[name].astype("boolean")
        for name in _NAMES:
            frame[name] = frame[name].astype("category")
        for name, order in _SCALES.items():
            frame[name] = pd.Categorical(frame[name], categories=order, ordered=True)
        came = frame[hazards].any(axis=1).astype("boolean")
        frame["hazard"] = came.mask(frame["status"] != Status.OK.value)
        frame["t_hazard"] = frame[[f"t_{name}" for name in hazards]].min(axis=1).astype(float)
        metrics = {metric.name: metric.unit for metric in self._head().metrics if metric.name in frame}
        frame.attrs["units"] = _units(frame) | metrics
        return frame

    def _hazards(self, columns: "Iterable[str]") -> tuple[str, ...]:
        """Return the hazards that the run's target checks; MutatorError if the table lacks one."""
        hazards, known = tuple(self._head()["hazards"]), set(columns)
        needed = (column.name for hazard in hazards for column in hazard_columns(hazard))
        if missing := next((name for name in needed if name not in known), None):
            raise self._no_table(f"no column '{missing}', although run.json names that hazard")
        return hazards

    def _head(self) -> Head:
        return read_head(self.path.parent)

    def propagation(self) -> "pd.DataFrame":
        """Return a frame of propagation.parquet, with a row for each channel that left golden."""
        return _frame(self.propagation_parquet())

    def propagation_parquet(self) -> bytes:
        return self._read(self.path.with_name(table_building.PROPAGATION))

    def timings(self) -> "pd.DataFrame":
        """Return a frame of timings.parquet, with a row for each experiment that ran."""
        return _frame(self.timings_parquet())

    def timings_parquet(self) -> bytes:
        return self._read(self.path.with_name(table_building.TIMINGS_PARQUET))

    def _check_header(self, columns: "Sequence[str] | pd.Index[str]") -> None:
        known = set(columns)
        if missing := [name for name in _NEEDED if name not in known]:
            raise self._no_table(f"no column '{missing[0]}'")

    def _no_table(self, why: str) -> MutatorError:
        return MutatorError(f"not a results table: {why}", where=self.path, remedy=_REMEDY)


def row_of(
    experiment: Experiment, record: Record, hazards: "Sequence[str]", scale: Scale | None = None
) -> Row:
    cells = table_cells.row(experiment, record, hazards, scale=scale)
    return row_from({name: "" if value is None else str(value) for name, value in cells.items()}, hazards)


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


def _frame(data: bytes) -> "pd.DataFrame":
    # a run's tables have no metadata; in a forged one, it could give columns each other's names
    table = _table(io.BytesIO(data))
    frame: pd.DataFrame = table.to_pandas(use_threads=False, ignore_metadata=True)
    return frame


def _table(source: Path | io.BytesIO) -> Any:
    """Read a Parquet file in this thread: pyarrow aborts the process if its threads free memory at exit."""
    import pyarrow as pa
    from pyarrow import parquet

    schema = parquet.read_schema(source)
    texts = [field.name for field in schema if pa.types.is_string(field.type)]
    file = parquet.ParquetFile(source, read_dictionary=texts, pre_buffer=False)
    size = source.stat().st_size if isinstance(source, Path) else source.getbuffer().nbytes
    _check_claim(file.metadata.num_rows * file.metadata.num_columns, "cells", size, MOST_CELLS)
    _check_claim(sum(unpacked for _, unpacked in _row_groups(file.metadata)), "bytes", size, MOST_TEXT)
    table = file.read(use_threads=False)
    _check_claim(sum(_text_bytes(table[name]) for name in texts), "bytes of text", size, MOST_TEXT)
    return table.cast(schema)


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


def _units(frame: "pd.DataFrame") -> dict[str, str]:
    """Return the unit of each numeric column. The unit of `value` is in the column `unit` of each row."""
    numbers = frame.select_dtypes("number").columns
    times = {name for name in numbers if name.startswith("t_")} | {"reaction_time"}
    times |= {column.name for column in SINCE}
    known = {name: "s" if name in times else "-" for name in numbers}
    known |= {name: "as its channel" for name in numbers if name.startswith(("max_dev_", "dev_"))}
    return known | {"value": "as the column `unit` says"}
