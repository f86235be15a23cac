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
from mutator.results.table_reader import same_parquet
from mutator.store.run_folder import RunFolder

_REMEDY = "`mutator report` rebuilds it"


def tables(folder: RunFolder) -> tuple[int, Iterator[MutatorError]]:
    """Return the number of tables, and their differences. A missing table is not a difference: it is built
    when needed.
    """
    there = [name for name in table_building.TABLES if (folder.path / name).is_file()]
    return len(there), _differences(folder, there)


def _differences(folder: RunFolder, there: list[str]) -> Iterator[MutatorError]:
    if not there:
        return
    with TemporaryDirectory() as scratch:
        made = {name: path_below(Path(scratch), name) for name in table_building.TABLES}
        table_building.write(folder, made)
        for name in there:
            path = path_below(folder.path, name)
            if name == table_building.CSV:
                try:
                    yield from _cells(path, made[name])
                except TooLarge as err:
                    yield err
            elif name not in made or not same_parquet(path, made[name]):
                yield MutatorError("does not follow from the records", where=path, remedy=_REMEDY)


def _cells(path: Path, made: Path) -> Iterator[MutatorError]:
    """Yield the lines that differ, each with its first differing cell."""
    with path.open("rb") as found, made.open("rb") as wanted:
        pairs = zip_longest(_texts(found, path), _texts(wanted, made))
        for number, (got, expected) in enumerate(pairs, start=1):
            if got is None or expected is None:
                told = [f"'{line.rstrip()}'" if line is not None else "no line" for line in (got, expected)]
            elif got != expected:
                cells = zip_longest(got.split(","), expected.split(","), fillvalue="")
                told = [f"'{cell.rstrip()}'" for cell in next(pair for pair in cells if pair[0] != pair[1])]
            else:
                continue
            yield MutatorError(told[0], where=path, line=number, expected=told[1], remedy=_REMEDY)


def _texts(file: BinaryIO, path: Path) -> Iterator[str]:
    return (line.decode(errors="replace") for line in read_bounded_lines(file, path))
