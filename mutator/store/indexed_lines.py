"""Lines of checksummed files, indexed by experiment. A line is parsed when it is read.

The index of a million experiments takes about 200 MB; their records as objects would take 5 GB.
"""

import os
import re
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from threading import Lock
from typing import Any, Generic, TypeVar

from mutator._common.hashing import parse_json
from mutator.errors import MutatorError
from mutator.store.checksummed_lines import unread_segment, verified_lines

_MOST_OPEN_FILES = 16  # each worker of each session wrote a file: all open could exceed a process's limit
# In a line of canonical JSON, this matches once: quotation marks inside a string are escaped.
_EXPERIMENT_ID_PATTERN = re.compile(rb'"experiment_id":"([^"\\]+)"')

T = TypeVar("T")


class IndexedLines(Mapping[str, T], Generic[T]):
    """Map each experiment to the object that `parse` creates from its line, in order of first appearance.

    `replaces(line, known)` decides whether a second line of an experiment replaces the first, or raises an
    error. MutatorError for a damaged line or unexpected content.
    """

    def __init__(
        self,
        paths: Iterable[Path],
        schema: str,
        parse: Callable[[dict[str, Any]], T],
        replaces: Callable[["IndexedLine", "IndexedLine"], bool],
    ) -> None:
        self._parse = parse
        self._files = OpenFiles(list(paths))
        self._index: dict[str, int] = {}
        self._last_parsed: tuple[str, T] | None = (
            None  # because some callers read an experiment twice in a row
        )
        self._file_numbers, self._line_numbers, self._offsets, self._lengths = (
            array(code) for code in "HLQL"
        )
        for file, path in enumerate(self._files.paths):
            self._index_file(file, path, schema, replaces)

    def _index_file(
        self, file: int, path: Path, schema: str, replaces: Callable[["IndexedLine", "IndexedLine"], bool]
    ) -> None:
        for number, offset, data in verified_lines(path, schema):
            name = _experiment_id_on(data)
            if name is None:
                raise self._damage_error(path, number)
            place = self._index.setdefault(name, len(self._offsets))
            if place == len(self._offsets):
                for column in (self._file_numbers, self._line_numbers, self._offsets, self._lengths):
                    column.append(0)
            elif not replaces(IndexedLine(path, number, data), self.read_line(name)):
                continue
            self._file_numbers[place], self._line_numbers[place] = file, number
            self._offsets[place], self._lengths[place] = offset, len(data)

    def read_line(self, experiment_id: str) -> "IndexedLine":
        at = self._index[experiment_id]
        file = self._file_numbers[at]
        data = self._files.read_part(file, self._offsets[at], self._lengths[at])
        return IndexedLine(self._files.paths[file], self._line_numbers[at], data)

    def __getitem__(self, name: str) -> T:
        last = self._last_parsed  # another thread can replace it in the meantime
        if last is None or last[0] != name:
            self._last_parsed = last = name, self._read_and_parse_line(name)
        return last[1]

    def _read_and_parse_line(self, experiment_id: str) -> T:
        line = self.read_line(experiment_id)
        try:
            return self._parse(line.parse())
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
            raise self._damage_error(line.path, line.number) from None

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def damage_error(self, line: "IndexedLine") -> MutatorError:
        return self._damage_error(line.path, line.number)

    def _damage_error(self, path: Path, number: int) -> MutatorError:
        return unread_segment(path).damage_error(number)


class IndexedLine:
    def __init__(self, path: Path, number: int, data: bytes) -> None:
        self.path, self.number, self.data = path, number, data

    def parse(self) -> dict[str, Any]:
        """Return the object on the line; ValueError if the line is not a JSON object."""
        value = parse_json(self.data)
        if not isinstance(value, dict):
            raise ValueError("not an object")
        value.pop("sum", None)
        return value


def _experiment_id_on(data: bytes) -> str | None:
    match = _EXPERIMENT_ID_PATTERN.search(data)
    return match[1].decode() if match else None


class OpenFiles:
    """Read parts of files, and keep a few files open."""

    def __init__(self, paths: list[Path]) -> None:
        self.paths = paths
        self._open: dict[int, int] = {}
        self._lock = Lock()

    def read_part(self, file: int, offset: int, length: int) -> bytes:
        with self._lock:  # no thread closes a file while another reads it
            if file not in self._open:
                if len(self._open) >= _MOST_OPEN_FILES:
                    os.close(self._open.pop(next(iter(self._open))))
                self._open[file] = os.open(self.paths[file], os.O_RDONLY | os.O_CLOEXEC)
            return os.pread(self._open[file], length, offset)

    def __del__(self) -> None:
        for opened in self._open.values():
            os.close(opened)
