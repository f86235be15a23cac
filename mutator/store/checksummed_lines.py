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

from mutator._common.bounded_reading import (
    MOST_EXPERIMENT_DATA_BYTES,
    open_regular,
    read_bounded_lines,
    read_open_file,
)
from mutator._common.files import check_schema, raising_disk_full, writing_atomic
from mutator._common.hashing import canonical_json
from mutator.errors import MutatorError

# A sync waits for the disk, and a power cut loses what was not synced: at most so many lines, or seconds of
# work.
_MOST_UNSYNCED, _MOST_UNSYNCED_S = 32, 2.0
# 16 digits find every accident. A file whose checksums were computed anew differs from `digests.json`.
_CHECKSUM_KEY, _CHECKSUM_DIGITS, _AFTER_CHECKSUM = b'{"sum":"', 16, b'",'
_CHECKSUM_SLICE = slice(len(_CHECKSUM_KEY), len(_CHECKSUM_KEY) + _CHECKSUM_DIGITS)
_BODY_START = len(_CHECKSUM_KEY) + _CHECKSUM_DIGITS + len(_AFTER_CHECKSUM)


class LineWriter:
    """Append checksummed JSON lines to a new file, synced in batches.

    The first line is `head`, which contains the schema, with the file's name added. `before_sync` is called
    before each sync, to sync the data to which the lines refer. If a line does not fit on the disk, it is
    removed again, and DiskFull is raised.
    """

    def __init__(
        self, path: Path, head: Mapping[str, Any], before_sync: Callable[[], None] = lambda: None
    ) -> None:
        self.path = path
        self._before_sync = before_sync
        self._unsynced = 0
        self._synced_at = time.monotonic()
        with raising_disk_full(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        self._end = 0
        self._hash = sha256()
        self._last_checksum = b""
        self.append(_head_with_file_name(path, head))

    def append(self, value: Mapping[str, Any]) -> None:
        self.extend([canonical_json(value).encode()])
        if self._unsynced >= _MOST_UNSYNCED:
            self.sync()

    def extend(self, values: Iterable[bytes]) -> None:
        """Append lines of canonical text. Only elapsed time triggers a sync."""
        lines, last_checksum = [], self._last_checksum
        for value in values:
            lines.append(_checksummed_line(last_checksum, value[1:]))
            last_checksum = lines[-1][_CHECKSUM_SLICE]
        data = b"".join(lines)
        with raising_disk_full(self.path):
            try:
                written = 0
                while written < len(data):
                    written += os.write(self._fd, data[written:])
            except OSError:  # half a line would make the next one look damaged
                os.ftruncate(self._fd, self._end)
                raise
        self._end += len(data)
        self._hash.update(data)
        self._last_checksum = last_checksum
        self._unsynced += len(lines)
        if time.monotonic() - self._synced_at > _MOST_UNSYNCED_S:
            self.sync()

    @property
    def sha256(self) -> str:
        """The digest of all bytes that this object wrote."""
        return self._hash.hexdigest()

    def sync(self) -> None:
        """Sync the file, so that appended lines survive a power cut."""
        self._before_sync()
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
    damaged_line_numbers: tuple[int, ...]
    complete_lines_end: int

    def damage_error(self, number: int) -> MutatorError:
        run = self.path.parent.parent
        mend = f"set it aside with `mutator verify {run} --repair`, then fill the gap with `mutator run`"
        return MutatorError(
            "a damaged line",
            where=self.path,
            line=number,
            expected="bytes that match its checksum",
            remedy=mend,
        )

    def parse_line(self, number: int) -> dict[str, Any]:
        """Return the object on a line, without its checksum; MutatorError if the line is not an object."""
        try:
            value = json.loads(self.lines[number])
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise self.damage_error(number)
        value.pop("sum", None)
        return value

    def without_checksum(self, line: bytes) -> bytes:
        return line[_BODY_START:]

    def check_head(self, expected_schema: str) -> None:
        """Raise MutatorError for another schema, or a file that was written under another name."""
        if 1 not in self.lines:
            return
        head = self.parse_line(1)
        check_schema(head.get("schema"), expected_schema, self.path)
        if head.get("file") != _name_with_folder(self.path):
            raise MutatorError(
                f"was written as {head.get('file')}",
                where=self.path,
                line=1,
                remedy="restore its name or its folder",
            )

    def numbered_objects(self, schema: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yield the number and content of each line after the head.

        MutatorError for damage, or another schema or file name.
        """
        if self.damaged_line_numbers:
            raise self.damage_error(self.damaged_line_numbers[0])
        self.check_head(schema)
        yield from ((number, self.parse_line(number)) for number in self.lines if number > 1)


def read_segment(path: Path, data: bytes | None = None) -> Segment:
    """Verify the lines of a file. `data` has its bytes, if they were already read. MutatorError if the file
    is missing.
    """
    data = _read_bytes(path) if data is None else data
    end = data.rfind(b"\n") + 1
    lines: dict[int, bytes] = {}
    damaged: list[int] = []
    last_checksum = b""
    for number, line in enumerate(data[:end].split(b"\n")[:-1], start=1):
        if is_intact_line(last_checksum, line):
            lines[number] = line
        else:
            damaged.append(number)
        last_checksum = line[_CHECKSUM_SLICE]
    return Segment(path=path, lines=lines, damaged_line_numbers=tuple(damaged), complete_lines_end=end)


def verified_lines(path: Path, schema: str) -> Iterator[tuple[int, int, bytes]]:
    """Yield the number, offset and bytes (without newline) of each complete line after the head.

    MutatorError for a damaged line, a missing file, or another schema or file name.
    """
    last_checksum, offset = b"", 0
    with _open_lines(path) as file:
        for number, line in enumerate(read_bounded_lines(file, path), start=1):
            if not line.endswith(b"\n"):  # incomplete, because the process was killed
                return
            data = line[:-1]
            if not is_intact_line(last_checksum, data):
                raise unread_segment(path).damage_error(number)
            if number == 1:
                unread_segment(path, {1: data}).check_head(schema)
            else:
                yield number, offset, data
            last_checksum = line[_CHECKSUM_SLICE]
            offset += len(line)


def intact_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the number and bytes of each complete, intact line. MutatorError if the file is missing."""
    last_checksum = b""
    with _open_lines(path) as file:
        for number, line in enumerate(read_bounded_lines(file, path), start=1):
            data = line[:-1]
            if line.endswith(b"\n") and is_intact_line(last_checksum, data):
                yield number, data
            last_checksum = line[_CHECKSUM_SLICE]


def unread_segment(path: Path, lines: Mapping[int, bytes] | None = None) -> Segment:
    return Segment(path=path, lines=lines or {}, damaged_line_numbers=(), complete_lines_end=0)


def checksum_of_line(line: bytes) -> bytes:
    """Return the checksum that a line states, which the next line's checksum covers."""
    return line[_CHECKSUM_SLICE]


def is_intact_line(last_checksum: bytes, line: bytes) -> bool:
    """Whether a line without its newline matches its checksum, after a line with `last_checksum`."""
    checksum = sha256(last_checksum + line[_BODY_START:]).hexdigest()[:_CHECKSUM_DIGITS].encode()
    return line[:_BODY_START] == b"".join((_CHECKSUM_KEY, checksum, _AFTER_CHECKSUM))


def _read_bytes(path: Path) -> bytes:
    with _open_lines(path) as file:
        return read_open_file(file, path, MOST_EXPERIMENT_DATA_BYTES)


def _open_lines(path: Path) -> BinaryIO:
    if path.is_file():
        return open_regular(path)
    raise MutatorError(
        "no file",
        where=path,
        expected="a file of lines",
        remedy="restore it from a copy of the run folder, or delete it; `mutator verify` lists what is lost",
    )


def line_file_bytes(path: Path, head: Mapping[str, Any], values: Iterable[Mapping[str, Any]]) -> bytes:
    """Return the bytes of a file at `path` after `values` were appended."""
    lines = [b""]
    for value in (_head_with_file_name(path, head), *values):
        lines.append(_checksummed_line(lines[-1][_CHECKSUM_SLICE], canonical_json(value).encode()[1:]))
    return b"".join(lines)


def write_lines_with_new_head(path: Path, head: Mapping[str, Any], lines: Iterable[bytes]) -> None:
    """Write a file with a new head, then lines of other files, with new checksums."""
    head_line = _checksummed_line(b"", canonical_json(_head_with_file_name(path, head)).encode()[1:])
    with writing_atomic(path) as file:
        file.write(head_line)
        last_checksum = head_line[_CHECKSUM_SLICE]
        for line in lines:
            copied = _checksummed_line(last_checksum, line[_BODY_START:])
            file.write(copied)
            last_checksum = copied[_CHECKSUM_SLICE]


def _checksummed_line(last_checksum: bytes, body: bytes) -> bytes:
    """Make a line of its checksum and `body`, an object without its opening brace."""
    checksum = sha256(last_checksum + body).hexdigest()[:_CHECKSUM_DIGITS].encode()
    return b"".join((_CHECKSUM_KEY, checksum, _AFTER_CHECKSUM, body, b"\n"))


def _head_with_file_name(path: Path, head: Mapping[str, Any]) -> dict[str, Any]:
    return {**head, "file": _name_with_folder(path)}


def _name_with_folder(path: Path) -> str:
    return f"{path.parent.name}/{path.name}"
