"""Audit tables: rebuild them from plan, records and timings, and compare."""

from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import BinaryIO

from mutator._common.bounded_reading import read_bounded_lines
from mutator._common.confined_files import path_below
from mutator.errors import MutatorError, TooLarge
from mutator.results import table_building
from mutator.results.table_reader import is_same_parquet
from mutator.store.run_folder import RunFolder

_TABLES_OF_RESULTS = (table_building.CSV_FILE, table_building.PARQUET_FILE)
_REMEDY = "`mutator report` rebuilds it"


def audit_tables(folder: RunFolder) -> tuple[int, Iterator[MutatorError]]:
    """Return the number of tables, and their differences. A missing table is not a difference: it is built
    when needed.
    """
    existing = [name for name in table_building.TABLE_FILES if (folder.path / name).is_file()]
    return len(existing), _table_problems(folder, existing)


def _table_problems(folder: RunFolder, existing: list[str]) -> Iterator[MutatorError]:
    if not existing:
        return
    with TemporaryDirectory() as scratch:
        rebuilt = {name: path_below(Path(scratch), name) for name in table_building.TABLE_FILES}
        table_building.write_tables(folder, rebuilt)
        if renamed := table_building.renamed_columns_of(folder):
            yield MutatorError(
                f"tables with the columns of another version of mutator ({renamed})",
                where=folder.path,
                remedy="`mutator report` rebuilds them",
            )
            existing = [name for name in existing if name not in _TABLES_OF_RESULTS]
        for name in existing:
            path = path_below(folder.path, name)
            if name == table_building.CSV_FILE:
                try:
                    yield from _differing_lines(path, rebuilt[name])
                except TooLarge as err:
                    yield err
            elif name not in rebuilt or not is_same_parquet(path, rebuilt[name]):
                yield MutatorError("does not follow from the records", where=path, remedy=_REMEDY)


def _differing_lines(path: Path, rebuilt_path: Path) -> Iterator[MutatorError]:
    """Yield the lines that differ, each with its first differing cell."""
    with path.open("rb") as current, rebuilt_path.open("rb") as rebuilt:
        pairs = zip_longest(_decoded_lines(current, path), _decoded_lines(rebuilt, rebuilt_path))
        for number, (got, expected) in enumerate(pairs, start=1):
            if got is None or expected is None:
                texts = [f"'{line.rstrip()}'" if line is not None else "no line" for line in (got, expected)]
            elif got != expected:
                cells = zip_longest(got.split(","), expected.split(","), fillvalue="")
                texts = [f"'{cell.rstrip()}'" for cell in next(pair for pair in cells if pair[0] != pair[1])]
            else:
                continue
            yield MutatorError(texts[0], where=path, line=number, expected=texts[1], remedy=_REMEDY)


def _decoded_lines(file: BinaryIO, path: Path) -> Iterator[str]:
    return (line.decode(errors="replace") for line in read_bounded_lines(file, path))
