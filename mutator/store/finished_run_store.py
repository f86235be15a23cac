"""The store of finished runs: records and series by what decides them, for every run folder on this machine.

The folder `finished` of the cache has

    <name>.runs          a segment: runs that were proved, or that the reference engine ran
    <digest>/<worker>    runs of a run folder whose proof is still to come; no search finds them

Each file consists of checksummed blocks (`checksummed_blocks`), one for each run, whose key is the run's key.
A segment is written once and then has its name; its last block is an index. So two commands never write to
the same file. What a power cut damages is found later, so nothing waits for the disk. Nothing is believed
that has another checksum or key; a caller compares the rest.
"""

import json
import os
import zlib
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from secrets import token_hex
from typing import Any, BinaryIO

from mutator._common.bounded_reading import decompress_bounded, open_regular
from mutator._common.cache_layout_and_pruning import finished_runs_folder, prune_finished_runs
from mutator._common.confined_files import path_below
from mutator._common.files import remove_folder
from mutator._common.hashing import canonical_json, digest
from mutator.errors import MutatorError
from mutator.model import Record
from mutator.store.checksummed_blocks import block_bytes, intact_blocks, parse_block
from mutator.store.records import record_as_json, record_from_json

SEGMENT_SUFFIX = ".runs"
_RUN_BLOCK, _INDEX_BLOCK = 0, 1  # kinds of blocks
_KEY_BYTES, _OFFSET_BYTES, _LENGTH_BYTES = 32, 8, 4
_ROW_BYTES = _KEY_BYTES + _OFFSET_BYTES + _LENGTH_BYTES  # of an index: key, and place of the run's block
_MOST_RUN_BYTES, _MOST_INDEX_BYTES = 64_000_000, 1_000_000_000  # a forged file can claim any size
_MOST_SEGMENT_BYTES = 200_000_000  # pruning deletes whole segments
_COMPRESSION_LEVEL = 1  # series are compressed already, and a record is short
_UNREADABLE = (
    OSError,
    MutatorError,
    ValueError,
    ArithmeticError,
    LookupError,
    TypeError,
    AttributeError,
    RecursionError,
    zlib.error,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FinishedRun:
    """A run as it is stored. `record` has the id of the experiment that ran.

    * `packages`: versions of the packages that the run loaded
    * `surroundings`: the digest of what all runs of its session had in common
    * `faulty_series`: the encoded series; None if its run folder keeps none
    * `executed`: the functions that it executed, as JSON; None if they are not known
    """

    record: Record
    packages: Mapping[str, str | None]
    surroundings: str
    faulty_series: bytes | None
    executed: dict[str, Any] | None = None

    def to_bytes(self) -> bytes:
        head = canonical_json(
            {
                "record": record_as_json(self.record),
                "packages": dict(self.packages),
                "surroundings": self.surroundings,
                "has_series": self.faulty_series is not None,
                "executed": self.executed,
            }
        )
        content = b"\n".join((head.encode(), self.faulty_series or b""))
        return zlib.compress(content, _COMPRESSION_LEVEL)

    @classmethod
    def from_bytes(cls, data: bytes) -> "FinishedRun":
        """Return what `to_bytes` packed. Other data raises one of several errors."""
        head, _, series = decompress_bounded(data, _MOST_RUN_BYTES).partition(b"\n")
        values = json.loads(head)
        return cls(
            record=record_from_json(values["record"]),
            packages=dict(values["packages"]),
            surroundings=str(values["surroundings"]),
            faulty_series=series if values["has_series"] else None,
            executed=values["executed"],
        )


class FinishedRuns:
    """The segments of the store, for searches. Segments that other commands add are found, too."""

    def __init__(self) -> None:
        self._folder = finished_runs_folder()
        self._segments: dict[str, _Segment | None] = {}
        self._folder_stamp = 0

    def find(self, key: str, is_usable: Callable[[FinishedRun], bool]) -> FinishedRun | None:
        """Return an intact and usable run with this key; None if there is none."""
        for segment in self._current_segments():
            for run in segment.runs_with_key(key):
                if is_usable(run):
                    segment.mark_as_used()
                    return run
        return None

    def find_all(self, key: str) -> Iterator[FinishedRun]:
        """Yield the intact runs with this key."""
        for segment in self._current_segments():
            yield from segment.runs_with_key(key)

    def has_any(self) -> bool:
        return any(True for _ in self._current_segments())

    def forget(self, key: str) -> None:
        """Delete each segment with this key: what is beside a wrong run is not believed either."""
        for segment in self._current_segments():
            if segment.has_key(key):
                with suppress(OSError):
                    segment.path.unlink(missing_ok=True)

    def _current_segments(self) -> Iterator["_Segment"]:
        with suppress(OSError):
            stamp = self._folder.stat().st_mtime_ns
            if stamp != self._folder_stamp:
                paths = {path.name: path for path in self._folder.glob(f"*{SEGMENT_SUFFIX}")}
                unchanged = {name: self._segments[name] for name in paths.keys() & self._segments.keys()}
                new = {name: _open_segment(paths[name]) for name in paths.keys() - unchanged.keys()}
                self._segments, self._folder_stamp = unchanged | new, stamp
        yield from (segment for segment in self._segments.values() if segment is not None)


@dataclass
class _Segment:
    """A segment with its index: sorted rows of key, offset and length."""

    path: Path
    rows: bytes
    _is_marked: bool = False

    def _row_key(self, number: int) -> bytes:
        return self.rows[number * _ROW_BYTES : number * _ROW_BYTES + _KEY_BYTES]

    def _places_of(self, key: str) -> Iterator[tuple[int, int]]:
        """Yield offset and length of each block with this key."""
        key_bytes, count = bytes.fromhex(key), len(self.rows) // _ROW_BYTES
        number = bisect_left(range(count), key_bytes, key=self._row_key)
        while number < count and self._row_key(number) == key_bytes:
            place = self.rows[number * _ROW_BYTES + _KEY_BYTES : (number + 1) * _ROW_BYTES]
            yield int.from_bytes(place[:_OFFSET_BYTES]), int.from_bytes(place[_OFFSET_BYTES:])
            number += 1

    def has_key(self, key: str) -> bool:
        return any(True for _ in self._places_of(key))

    def runs_with_key(self, key: str) -> Iterator[FinishedRun]:
        for offset, length in self._places_of(key):
            try:
                with open_regular(self.path) as file:
                    file.seek(offset)
                    block = parse_block(file.read(min(length, _MOST_RUN_BYTES)))
                if block is not None and (block.kind, block.key) == (_RUN_BLOCK, key):
                    yield FinishedRun.from_bytes(block.data)
            except _UNREADABLE:
                continue  # damaged, or pruned meanwhile

    def mark_as_used(self) -> None:
        if not self._is_marked:
            self._is_marked = True
            with suppress(OSError):
                os.utime(self.path)


def _open_segment(path: Path) -> _Segment | None:
    """Read the index of a segment; None if it is damaged."""
    try:
        with open_regular(path) as file:
            size = os.fstat(file.fileno()).st_size
            file.seek(max(0, size - _OFFSET_BYTES))
            index_start = int.from_bytes(file.read(_OFFSET_BYTES))
            if not 0 <= index_start < size or size - index_start > _MOST_INDEX_BYTES:
                return None
            file.seek(index_start)
            block = parse_block(file.read(size - index_start - _OFFSET_BYTES))
    except OSError:
        return None
    is_index = block is not None and block.kind == _INDEX_BLOCK and len(block.data) % _ROW_BYTES == 0
    return _Segment(path, block.data) if block is not None and is_index else None


def store_finished_runs(runs: Iterable[tuple[str, FinishedRun]]) -> None:
    """Store runs by key in new segments, and prune the store to its limit. An unwritable cache is ignored."""
    remaining = iter(runs)
    with suppress(OSError):
        while (first := next(remaining, None)) is not None:
            _write_segment(first, remaining)
        prune_finished_runs()


def _write_segment(first: tuple[str, FinishedRun], remaining: Iterator[tuple[str, FinishedRun]]) -> None:
    folder = finished_runs_folder()
    folder.mkdir(parents=True, exist_ok=True)
    name, rows, end = token_hex(16), list[bytes](), 0
    temporary = path_below(folder, f".{name}.0")
    try:
        with temporary.open("xb") as file:
            run: tuple[str, FinishedRun] | None = first
            while run is not None:
                block = block_bytes(_RUN_BLOCK, run[0], run[1].to_bytes())
                file.write(block)
                place = end.to_bytes(_OFFSET_BYTES) + len(block).to_bytes(_LENGTH_BYTES)
                rows.append(bytes.fromhex(run[0]) + place)
                end += len(block)
                run = next(remaining, None) if end < _MOST_SEGMENT_BYTES else None
            file.write(block_bytes(_INDEX_BLOCK, "", b"".join(sorted(rows))))
            file.write(end.to_bytes(_OFFSET_BYTES))
        temporary.rename(path_below(folder, f"{name}{SEGMENT_SUFFIX}"))
    finally:
        temporary.unlink(missing_ok=True)


@dataclass
class UnprovedRuns:
    """The runs of a run folder that are stored once its proof is complete.

    `writer_name` names the file of this process. An unwritable cache is ignored.
    """

    run_folder: Path
    plan: str
    writer_name: str = ""
    _file: BinaryIO | None = None
    _is_unwritable: bool = False
    _folder: Path = field(init=False)

    def __post_init__(self) -> None:
        self._folder = path_below(
            finished_runs_folder(), digest([str(self.run_folder.resolve()), self.plan])[:32]
        )

    def append(self, key: str, run: FinishedRun) -> None:
        if self._is_unwritable:
            return
        try:
            if self._file is None:
                self._folder.mkdir(parents=True, exist_ok=True)
                self._file = path_below(self._folder, f"{self.writer_name}-{token_hex(4)}").open("xb")
            self._file.write(block_bytes(_RUN_BLOCK, key, run.to_bytes()))
            self._file.flush()
        except OSError:
            self._is_unwritable = True

    def close(self) -> None:
        if self._file is not None:
            with suppress(OSError):
                self._file.close()

    def __iter__(self) -> Iterator[tuple[str, FinishedRun]]:
        """Yield the intact runs, with their keys."""
        with suppress(OSError):
            for path in sorted(self._folder.iterdir()):
                try:
                    for block in intact_blocks(path):
                        yield block.key, FinishedRun.from_bytes(block.data)
                except _UNREADABLE:
                    continue

    def delete(self) -> None:
        remove_folder(self._folder)
