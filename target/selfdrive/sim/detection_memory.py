"""Detection results by picture, in a file of fixed size that all runs share.

An entry has the digest of all inputs of a detection, a checksum, and numbers. Processes use the file
concurrently without a lock: if an entry is damaged, incomplete or overwritten, the reader repeats the
detection and writes the entry again. If the file cannot be created, nothing is stored.
"""

import os
import struct
from collections.abc import Sequence
from hashlib import blake2b
from pathlib import Path

FILE_NAME = "detections-1.table"
MOST_NUMBERS = 20  # largest number of values in an entry
KEY_BYTES, CHECK_BYTES = 16, 8  # bytes
_NUMBERS_FORMAT = struct.Struct(f"<q{MOST_NUMBERS}d")
ENTRY_BYTES = KEY_BYTES + CHECK_BYTES + _NUMBERS_FORMAT.size  # 192 bytes
ENTRIES_PER_BUCKET = 8  # entries in a bucket; a key can be in any of them
BUCKET_COUNT = 1 << 19  # 2^22 entries, enough for two large campaigns: 805 MB when all are used
_BUCKET_BYTES = ENTRIES_PER_BUCKET * ENTRY_BYTES


class DetectionMemory:
    """The table in the folder `cache`. `recall` and `keep` never raise."""

    def __init__(self, cache: Path) -> None:
        self._file = _open_table(cache / FILE_NAME)

    def recall(self, key: bytes) -> tuple[float, ...] | None:
        """Return the numbers stored under a key of KEY bytes; None if there are none."""
        bucket = self._bucket(key)
        at = _find_entry(bucket, key)
        if at is None:
            return None
        value = bucket[at + KEY_BYTES + CHECK_BYTES : at + ENTRY_BYTES]
        if bucket[at + KEY_BYTES : at + KEY_BYTES + CHECK_BYTES] != _checksum(key, value):
            return None
        count, *numbers = _NUMBERS_FORMAT.unpack(value)
        return tuple(numbers[:count])

    def store(self, key: bytes, numbers: Sequence[float]) -> None:
        """Store at most MOST numbers under a key. In a full bucket they replace another entry."""
        if self._file is None:
            return
        bucket = self._bucket(key)
        at = _find_entry(bucket, key)
        if at is None:
            at = _find_entry(bucket, bytes(KEY_BYTES))
        if at is None:
            at = key[-1] % ENTRIES_PER_BUCKET * ENTRY_BYTES
        value = _NUMBERS_FORMAT.pack(len(numbers), *numbers, *([0.0] * (MOST_NUMBERS - len(numbers))))
        try:
            os.pwrite(self._file.fileno(), key + _checksum(key, value) + value, _bucket_start(key) + at)
        except OSError:
            self._file = None

    def _bucket(self, key: bytes) -> bytes:
        bucket = b""
        if self._file is not None:
            try:
                bucket = os.pread(self._file.fileno(), _BUCKET_BYTES, _bucket_start(key))
            except OSError:
                self._file = None
        return bucket.ljust(_BUCKET_BYTES, b"\0")


def _open_table(path: Path):
    """The table's file, created if missing; None if that fails.

    It is read and written by position, not mapped, so that a full disk causes an error, not a signal, and
    processes that share the open file after a fork do not move each other's position.
    """
    if not hasattr(os, "pwrite"):
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o644), "r+b", buffering=0)
        if os.fstat(file.fileno()).st_size < BUCKET_COUNT * _BUCKET_BYTES:
            file.truncate(BUCKET_COUNT * _BUCKET_BYTES)  # sparse until entries are written
    except OSError:
        return None
    return file


def _bucket_start(key: bytes) -> int:
    return int.from_bytes(key[:8], "little") % BUCKET_COUNT * _BUCKET_BYTES


def _find_entry(bucket: bytes, key: bytes) -> int | None:
    for at in range(0, _BUCKET_BYTES, ENTRY_BYTES):
        if bucket[at : at + KEY_BYTES] == key:
            return at
    return None


def _checksum(key: bytes, value: bytes) -> bytes:
    return blake2b(key + value, digest_size=CHECK_BYTES).digest()
