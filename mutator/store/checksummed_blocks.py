"""Files of checksummed blocks of bytes, which hold patches and series. One process appends to each file.

A block consists of a head of 19 bytes, a key (text) and the content. The head is little-endian: the mark
`FIB1`, a kind (1 byte), the length of the key (2) and of the content (4), and the first 8 bytes of the
SHA-256 of the rest of the block. A changed block is detected, and the blocks after it remain readable.
"""

import os
import struct
import time
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from mutator._common.bounded_reading import MOST_EXPERIMENT_DATA_BYTES, read_bounded
from mutator._common.files import raising_disk_full

_BLOCK_MARK = b"FIB1"
# 8 bytes find every accident. A forged patch does not match the digest in its record, a forged series not the
# deviations there.
_HEAD_STRUCT, _CHECKSUM_BYTES = struct.Struct("<4sBHI"), 8
_MOST_SEARCH_READS = 8  # how many times the bytes of a file a search may verify
# A sync waits for the disk, and a power cut loses what was not synced: at most so many blocks, or seconds of
# work.
_MOST_UNSYNCED, _MOST_UNSYNCED_S = 32, 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """An appended block. The file's owner chooses `kind`; `offset` is where the content starts."""

    kind: int
    key: str
    data: bytes
    offset: int


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockFile:
    """The content of a block file.

    An incomplete last block is not damage: a killed process can leave one.
    """

    path: Path
    blocks: tuple[Block, ...]
    is_damaged: bool


class BlockWriter:
    """Append blocks to a new file, synced in batches.

    If a block does not fit on the disk, it is removed again, and DiskFull is raised.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._unsynced, self._synced_at, self._end = 0, time.monotonic(), 0
        with raising_disk_full(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)

    def append(self, kind: int, key: str, data: bytes) -> None:
        self.extend(block_bytes(kind, key, data))
        if self._unsynced >= _MOST_UNSYNCED:
            self.sync()

    def extend(self, blocks: bytes) -> None:
        """Append complete blocks that were built elsewhere. Only elapsed time triggers a sync."""
        with raising_disk_full(self.path):
            try:
                written = 0
                while written < len(blocks):
                    written += os.write(self._fd, blocks[written:])
            except OSError:  # half a block would make the next one look damaged
                os.ftruncate(self._fd, self._end)
                raise
        self._end += len(blocks)
        self._unsynced += 1
        if time.monotonic() - self._synced_at > _MOST_UNSYNCED_S:
            self.sync()

    def sync(self) -> None:
        """Sync the file, so that appended blocks survive a power cut."""
        if self._unsynced:
            with raising_disk_full(self.path):
                os.fsync(self._fd)
        self._unsynced, self._synced_at = 0, time.monotonic()

    def close(self) -> None:
        try:
            self.sync()
        finally:
            os.close(self._fd)


def block_bytes(kind: int, key: str, data: bytes) -> bytes:
    text = key.encode()
    head = _HEAD_STRUCT.pack(_BLOCK_MARK, kind, len(text), len(data))
    check = sha256(b"".join((head, text, data))).digest()[:_CHECKSUM_BYTES]
    return b"".join((head, check, text, data))


def parse_block(data: bytes) -> Block | None:
    """Return the block that `data` begins with; None if it is damaged."""
    return _block_at(data, 0)


def read_blocks(path: Path) -> BlockFile:
    parts = list(_blocks_or_none(read_bounded(path, MOST_EXPERIMENT_DATA_BYTES)))
    blocks = tuple(block for block in parts if block is not None)
    return BlockFile(path=path, blocks=blocks, is_damaged=len(blocks) < len(parts))


def intact_blocks(path: Path) -> Iterator[Block]:
    yield from (
        block
        for block in _blocks_or_none(read_bounded(path, MOST_EXPERIMENT_DATA_BYTES))
        if block is not None
    )


def _blocks_or_none(data: bytes) -> Iterator[Block | None]:
    """Yield the intact blocks, and None for each damaged part."""
    at, search = 0, _BlockSearch(data)
    while at < len(data):
        block = _block_at(data, at)
        if block is not None:
            yield block
            at = block.offset + len(block.data)
            continue
        following = search.next_block_after(at)
        if following is not None or not _is_cut_off(data, at):
            yield None
        at = len(data) if following is None else following


def _block_at(data: bytes, at: int) -> Block | None:
    begin = at + _HEAD_STRUCT.size + _CHECKSUM_BYTES
    if begin > len(data):
        return None
    end = _claimed_end(data, at)
    if end is None or end > len(data):
        return None
    _, kind, key_length, _ = _HEAD_STRUCT.unpack_from(data, at)
    check = data[at + _HEAD_STRUCT.size : begin]
    if sha256(data[at : at + _HEAD_STRUCT.size] + data[begin:end]).digest()[:_CHECKSUM_BYTES] != check:
        return None
    offset = begin + key_length
    key = data[begin:offset].decode(errors="replace")
    return Block(kind=kind, key=key, data=data[offset:end], offset=offset)


def _claimed_end(data: bytes, at: int) -> int | None:
    """Return where the block that begins at this offset says that it ends; None if none begins there."""
    mark, _, key_length, data_length = _HEAD_STRUCT.unpack_from(data, at)
    return (
        at + _HEAD_STRUCT.size + _CHECKSUM_BYTES + key_length + data_length if mark == _BLOCK_MARK else None
    )


class _BlockSearch:
    """Finds the next intact block after damage.

    Bytes in the damaged part can look like many long blocks, so the search ends when it has verified a
    multiple of the file's bytes.
    """

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._remaining_bytes = _MOST_SEARCH_READS * len(data)

    def next_block_after(self, at: int) -> int | None:
        while self._remaining_bytes > 0 and (at := self._data.find(_BLOCK_MARK, at + 1)) >= 0:
            if _block_at(self._data, at) is not None:
                return at
            end = _claimed_end(self._data, at) if at + _HEAD_STRUCT.size <= len(self._data) else None
            self._remaining_bytes -= end - at if end and end <= len(self._data) else 0
        return None


def _is_cut_off(data: bytes, at: int) -> bool:
    """Return whether the block that begins at this offset is cut off by the end of the file."""
    if len(data) - at < _HEAD_STRUCT.size + _CHECKSUM_BYTES:
        return _BLOCK_MARK.startswith(data[at : at + len(_BLOCK_MARK)])
    end = _claimed_end(data, at)
    return end is not None and end > len(data)
