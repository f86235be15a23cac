"""Files of checksummed lines. One process appends to each file. Bytes are verified before they are parsed.

A line is a JSON object that begins with its checksum, `{"sum":"<16 hex>",...}`: a shortened SHA-256 of the
previous line's checksum and of all bytes after its own checksum. A changed, missing, duplicate or moved line
is therefore detected, and the lines after it can still be verified.
"""

import json
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, BinaryIO

from mutator._common.bounded import MOST_DATA, bounded_lines, open_regular, read_open
from mutator._common.files import check_schema, raising_disk_full, writing_atomic
from mutator._common.hashing import canonical
from mutator.errors import MutatorError

_BATCH = 32  # the most lines between two syncs
_BATCH_S = 2.0  # the longest time between two syncs
_KEY, _WIDTH, _AFTER = b'{"sum":"', 16, b'",'
_SUM = slice(len(_KEY), len(_KEY) + _WIDTH)
_BODY = len(_KEY) + _WIDTH + len(_AFTER)


class LineWriter:
    """Append checksummed JSON lines to a new file, synced in batches.

    The first line is `head`, which contains the schema, with the file's name added. `first` is called before
    each sync, to sync the data to which the lines refer. If a line does not fit on the disk, it is removed
    again, and DiskFull is raised.
    """

    def __init__(self, path: Path, head: Mapping[str, Any], first: Callable[[], None] = lambda: None) -> None:
        self.path = path
        self._first = first
        self._unsynced = 0
        self._synced_at = time.monotonic()
        with raising_disk_full(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        self._end = 0
        self._sum = sha256()
        self._last = b""
        self.append(_head(path, head))

    def append(self, value: Mapping[str, Any]) -> None:
        self.extend([canonical(value).encode()])
        if self._unsynced >= _BATCH:
            self.sync()

    def extend(self, values: Iterable[bytes]) -> None:
        """Append lines of canonical text. Only elapsed time triggers a sync."""
        lines, last = [], self._last
        for value in values:
            lines.append(_line(last, value[1:]))
            last = lines[-1][_SUM]
        data = b"".join(lines)
        with raising_disk_full(self.path):
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._fd, data[written:])
            except OSError:
                os.ftruncate(self._fd, self._end)
                raise
        self._end += len(data)
        self._sum.update(data)
        self._last = last
        self._unsynced += len(lines)
        if time.monotonic() - self._synced_at > _BATCH_S:
            self.sync()

    @property
    def sha256(self) -> str:
        """The digest of all bytes that this object wrote."""
        return self._sum.hexdigest()

    def sync(self) -> None:
        """Sync the file, so that appended lines survive a power cut."""
        self._first()
        with raising_disk_full(self.path):
            os.fsync(self._fd)
        self._unsynced = 0
        self._synced_at = time.monotonic()

    def close(self) -> None:
        try:
            self.sync()
        finally:
            os.close(self._fd)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """The content of a line file: intact lines by number from 1, numbers of damaged lines, and the end of the
    last complete line.

    Bytes after that end are an incomplete line, which a killed process leaves.
    """

    path: Path
    lines: Mapping[int, bytes]
    damaged: tuple[int, ...]
    end: int

    def problem(self, number: int) -> MutatorError:
        run = self.path.parent.parent
        mend = f"set it aside with `mutator verify {run} --repair`, then fill the gap with `mutator run`"
        return MutatorError(
            "a damaged line",
            where=self.path,
            line=number,
            expected="bytes that match its checksum",
            remedy=mend,
        )

    def content(self, number: int) -> dict[str, Any]:
        """Return the object on a line, without its checksum; MutatorError if the line is not an object."""
        try:
            value = json.loads(self.lines[number])
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise self.problem(number)
        value.pop("sum", None)
        return value

    def body(self, number: int) -> bytes:
        """Return a line without its checksum."""
        return self.body_of(self.lines[number])

    def body_of(self, line: bytes) -> bytes:
        return line[_BODY:]

    def check_head(self, schema: str) -> None:
        """Raise MutatorError for another schema, or a file that was written under another name."""
        if 1 not in self.lines:
            return
        head = self.content(1)
        check_schema(head.get("schema"), schema, self.path)
        if head.get("file") != _name(self.path):
            raise MutatorError(
                f"was written as {head.get('file')}",
                where=self.path,
                line=1,
                remedy="restore its name or its folder",
            )

    def objects(self, schema: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the number and content of each line after the head.

        MutatorError for damage, or another schema or file name.
        """
        if self.damaged:
            raise self.problem(self.damaged[0])
        self.check_head(schema)
        yield from ((number, self.content(number)) for number in self.lines if number > 1)


def read_segment(path: Path, data: bytes | None = None) -> Segment:
    """Verify the lines of a file. `data` has its bytes, if they were already read. MutatorError if the file
    is missing.
    """
    data = _read(path) if data is None else data
    end = data.rfind(b"\n") + 1
    lines: dict[int, bytes] = {}
    damaged: list[int] = []
    last = b""
    for number, line in enumerate(data[:end].split(b"\n")[:-1], start=1):
        if _is_intact(last, line):
            lines[number] = line
        else:
            damaged.append(number)
        last = line[_SUM]
    return Segment(path=path, lines=lines, damaged=tuple(damaged), end=end)


def verified_lines(path: Path, schema: str) -> Iterator[tuple[int, int, bytes]]:
    """Yield the number, offset and bytes (without newline) of each complete line after the head.

    MutatorError for a damaged line, a missing file, or another schema or file name.
    """
    last, offset = b"", 0
    with _opened(path) as file:
        for number, line in enumerate(bounded_lines(file, path), start=1):
            if not line.endswith(b"\n"):  # incomplete, because the process was killed
                return
            data = line[:-1]
            if not _is_intact(last, data):
                raise bare_segment(path).problem(number)
            if number == 1:
                bare_segment(path, {1: data}).check_head(schema)
            else:
                yield number, offset, data
            last = line[_SUM]
            offset += len(line)


def intact_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the number and bytes of each complete, intact line. MutatorError if the file is missing."""
    last = b""
    with _opened(path) as file:
        for number, line in enumerate(bounded_lines(file, path), start=1):
            data = line[:-1]
            if line.endswith(b"\n") and _is_intact(last, data):
                yield number, data
            last = line[_SUM]


def bare_segment(path: Path, lines: Mapping[int, bytes] | None = None) -> Segment:
    return Segment(path=path, lines=lines or {}, damaged=(), end=0)


def _is_intact(last: bytes, line: bytes) -> bool:
    found = sha256(last + line[_BODY:]).hexdigest()[:_WIDTH].encode()
    return line[:_BODY] == b"".join((_KEY, found, _AFTER))


def _read(path: Path) -> bytes:
    with _opened(path) as file:
        return read_open(file, path, MOST_DATA)


def _opened(path: Path) -> BinaryIO:
    if path.is_file():
        return open_regular(path)
    raise MutatorError(
        "no file",
        where=path,
        expected="a file of lines",
        remedy="restore it from a copy of the run folder, or delete it; `mutator verify` lists what is lost",
    )


def written(path: Path, head: Mapping[str, Any], values: Iterable[Mapping[str, Any]]) -> bytes:
    """Return the bytes of a file at `path` after `values` were appended."""
    lines = [b""]
    for value in (_head(path, head), *values):
        lines.append(_line(lines[-1][_SUM], canonical(value).encode()[1:]))
    return b"".join(lines)


def write_copy(path: Path, head: Mapping[str, Any], lines: Iterable[bytes]) -> None:
    """Write a file with a new head, then lines of other files, with new checksums."""
    first = _line(b"", canonical(_head(path, head)).encode()[1:])
    with writing_atomic(path) as file:
        file.write(first)
        last = first[_SUM]
        for line in lines:
            copied = _line(last, line[_BODY:])
            file.write(copied)
            last = copied[_SUM]


def _line(last: bytes, body: bytes) -> bytes:
    """Make a line of its checksum and `body`, an object without its opening brace."""
    checksum = sha256(last + body).hexdigest()[:_WIDTH].encode()
    return b"".join((_KEY, checksum, _AFTER, body, b"\n"))


def _head(path: Path, head: Mapping[str, Any]) -> dict[str, Any]:
    return {**head, "file": _name(path)}


def _name(path: Path) -> str:
    return f"{path.parent.name}/{path.name}"
