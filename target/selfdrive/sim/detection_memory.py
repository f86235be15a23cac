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

FILE = "detections-1.table"
MOST = 20  # largest number of values in an entry
KEY, CHECK = 16, 8  # bytes
_VALUE = struct.Struct(f"<q{MOST}d")
ENTRY = KEY + CHECK + _VALUE.size  # 192 bytes
WAYS = 8  # entries in a bucket; a key can be in any of them
BUCKETS = 1 << 19  # 2^22 entries, enough for two large campaigns: 805 MB when all are used
_BUCKET = WAYS * ENTRY


class DetectionMemory:
    """The table in the folder `cache`. `recall` and `keep` never raise."""

    def __init__(self, cache: Path) -> None:
        self._file = _opened(cache / FILE)

    def recall(self, key: bytes) -> tuple[float, ...] | None:
        """Return the numbers stored under a key of KEY bytes; None if there are none."""
        bucket = self._bucket(key)
        at = _place(bucket, key)
        if at is None:
            return None
        value = bucket[at + KEY + CHECK : at + ENTRY]
        if bucket[at + KEY : at + KEY + CHECK] != _check(key, value):
            return None
        count, *numbers = _VALUE.unpack(value)
        return tuple(numbers[:count])

    def keep(self, key: bytes, numbers: Sequence[float]) -> None:
        """Store at most MOST numbers under a key. In a full bucket they replace another entry."""
        if self._file is None:
            return
        bucket = self._bucket(key)
        at = _place(bucket, key)
        if at is None:
            at = _place(bucket, bytes(KEY))
        if at is None:
            at = key[-1] % WAYS * ENTRY
        value = _VALUE.pack(len(numbers), *numbers, *([0.0] * (MOST - len(numbers))))
        try:
            os.pwrite(self._file.fileno(), key + _check(key, value) + value, _start(key) + at)
        except OSError:
            self._file = None

    def _bucket(self, key: bytes) -> bytes:
        bucket = b""
        if self._file is not None:
            try:
                bucket = os.pread(self._file.fileno(), _BUCKET, _start(key))
            except OSError:
                self._file = None
        return bucket.ljust(_BUCKET, b"\0")


def _opened(path: Path):
    """The table's file, created if missing; None if that fails.

    It is read and written by position, not mapped, so that a full disk causes an error, not a signal, and
    processes that share the open file after a fork do not move each other's position.
    """
    if not hasattr(os, "pwrite"):
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o644), "r+b", buffering=0)
        if os.fstat(file.fileno()).st_size < BUCKETS * _BUCKET:
            file.truncate(BUCKETS * _BUCKET)  # sparse until entries are written
    except OSError:
        return None
    return file


def _start(key: bytes) -> int:
    return int.from_bytes(key[:8], "little") % BUCKETS * _BUCKET


def _place(bucket: bytes, key: bytes) -> int | None:
    for at in range(0, _BUCKET, ENTRY):
        if bucket[at : at + KEY] == key:
            return at
    return None


def _check(key: bytes, value: bytes) -> bytes:
    return blake2b(key + value, digest_size=CHECK).digest()
