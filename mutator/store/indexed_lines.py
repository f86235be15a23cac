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

from mutator._common.hashing import from_json
from mutator.errors import MutatorError
from mutator.store.checksummed_lines import bare_segment, verified_lines

_OPEN = 16  # the most files to keep open
_ID = re.compile(rb'"experiment_id":"([^"\\]+)"')  # matches once in a line of canonical JSON

T = TypeVar("T")


class IndexedLines(Mapping[str, T], Generic[T]):
    """Map each experiment to the object that `made` creates from its line, in order of first appearance.

    `replaces(line, known)` decides whether a second line of an experiment replaces the first, or raises an
    error. MutatorError for a damaged line or unexpected content.
    """

    def __init__(
        self,
        paths: Iterable[Path],
        schema: str,
        made: Callable[[dict[str, Any]], T],
        replaces: Callable[["Line", "Line"], bool],
    ) -> None:
        self._made = made
        self._files = Files(list(paths))
        self._index: dict[str, int] = {}
        self._last: tuple[str, T] | None = None  # because some callers read an experiment twice in a row
        self._file, self._number, self._offset, self._length = (array(code) for code in "HLQL")
        for file, path in enumerate(self._files.paths):
            self._read(file, path, schema, replaces)

    def _read(self, file: int, path: Path, schema: str, replaces: Callable[["Line", "Line"], bool]) -> None:
        for number, offset, data in verified_lines(path, schema):
            name = _name(data)
            if name is None:
                raise self._problem(path, number)
            known = self._index.setdefault(name, len(self._offset))
            if known == len(self._offset):
                for column in (self._file, self._number, self._offset, self._length):
                    column.append(0)
            elif not replaces(Line(path, number, data), self.line(name)):
                continue
            self._file[known], self._number[known] = file, number
            self._offset[known], self._length[known] = offset, len(data)

    def line(self, name: str) -> "Line":
        at = self._index[name]
        file = self._file[at]
        data = self._files.read(file, self._offset[at], self._length[at])
        return Line(self._files.paths[file], self._number[at], data)

    def __getitem__(self, name: str) -> T:
        last = self._last  # another thread can replace it in the meantime
        if last is None or last[0] != name:
            self._last = last = name, self._read_one(name)
        return last[1]

    def _read_one(self, name: str) -> T:
        line = self.line(name)
        try:
            return self._made(line.content())
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError):
            raise self._problem(line.path, line.number) from None

    def __contains__(self, name: object) -> bool:
        return name in self._index

    def __iter__(self) -> Iterator[str]:
        return iter(self._index)

    def __len__(self) -> int:
        return len(self._index)

    def problem(self, line: "Line") -> MutatorError:
        return self._problem(line.path, line.number)

    def _problem(self, path: Path, number: int) -> MutatorError:
        return bare_segment(path).problem(number)


class Line:
    def __init__(self, path: Path, number: int, data: bytes) -> None:
        self.path, self.number, self.data = path, number, data

    def content(self) -> dict[str, Any]:
        """Return the object on the line; ValueError if the line is not a JSON object."""
        value = from_json(self.data)
        if not isinstance(value, dict):
            raise ValueError("not an object")
        value.pop("sum", None)
        return value


def _name(data: bytes) -> str | None:
    found = _ID.search(data)
    return found[1].decode() if found else None


class Files:
    """Read parts of files, and keep a few files open."""

    def __init__(self, paths: list[Path]) -> None:
        self.paths = paths
        self._open: dict[int, int] = {}
        self._lock = Lock()

    def read(self, file: int, offset: int, length: int) -> bytes:
        with self._lock:  # no thread closes a file while another reads it
            if file not in self._open:
                if len(self._open) >= _OPEN:
                    os.close(self._open.pop(next(iter(self._open))))
                self._open[file] = os.open(self.paths[file], os.O_RDONLY | os.O_CLOEXEC)
            return os.pread(self._open[file], length, offset)

    def __del__(self) -> None:
        for opened in self._open.values():
            os.close(opened)
