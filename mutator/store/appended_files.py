"""Files of a run folder that only grow, with the digest of all that is in them."""

import os
from collections.abc import Iterable, Iterator
from hashlib import sha256
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import open_descriptor_below, path_below, read_below, write_below
from mutator._common.files import raising_disk_full
from mutator._common.hashing import digest
from mutator.errors import MutatorError
from mutator.store import file_digests
from mutator.store.file_digests import DigestLedger, FileDigest
from mutator.store.plan_file import EXPERIMENTS_FILE
from mutator.store.run_head import HEAD


class AppendedFile:
    """A file that grows. `digest` is what it has once `write_added` has written what was added."""

    def __init__(self, run: Path, name: str) -> None:
        self.name = name
        self._run = run
        path = path_below(run, name)
        data = read_bounded(path) if path.is_file() else b""
        self._hash, self._size = sha256(data), len(data)
        self._added = b""
        self._is_replaced = False

    def replace(self, data: bytes) -> None:
        """Let the file have this content instead."""
        self._hash, self._size, self._added, self._is_replaced = sha256(data), len(data), data, True

    def add(self, data: bytes) -> None:
        self._added += data
        self._hash.update(data)
        self._size += len(data)

    @property
    def digest(self) -> FileDigest:
        return FileDigest(size=self._size, sha256=self._hash.hexdigest())

    def write_added(self) -> None:
        added, self._added = self._added, b""
        if self._is_replaced:
            self._is_replaced = False
            write_below(self._run, self.name, added)
            return
        with raising_disk_full(path_below(self._run, self.name)):
            file = open_descriptor_below(self._run, self.name, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            try:
                while added:
                    added = added[os.write(file, added) :]
                os.fsync(file)  # run.json must not name bytes that a power cut can still take
            finally:
                os.close(file)


def undo_unfinished_growth(run: Path, names: Iterable[str]) -> list[str]:
    """Cut off what a failed or killed command added to these files, unless it also wrote the run.json that
    has it. Return the names of the files that were cut.
    """
    cut_names: list[str] = []
    ledger = file_digests.load_ledger(run)
    if not ledger.rewriting or _has_new_head(run, ledger):
        return cut_names
    for name in names:
        before = ledger.files.get(name)
        if before is None or not path_below(run, name).is_file():
            continue
        data = read_below(run, name)
        if len(data) > before.size and digest(data[: before.size]) == before.sha256:
            _cut_in_place(run, name, before.size)
            cut_names.append(name)
    return cut_names


def unfinished_growth_problems(run: Path, ledger: DigestLedger) -> Iterator[MutatorError]:
    """Yield why a plan does not match its digests, if a killed command had begun to add a batch."""
    if EXPERIMENTS_FILE in ledger.rewriting and not _has_new_head(run, ledger):
        yield MutatorError(
            "a killed command had begun to plan a batch",
            where=run,
            expected="whole batches",
            remedy=f"open the bench again, or cut the batch off with `mutator verify {run} --repair`",
        )


def _has_new_head(run: Path, ledger: DigestLedger) -> bool:
    new_head = ledger.rewriting.get(HEAD)
    return new_head is not None and new_head.has_same_bytes(FileDigest.of_file_below(run, HEAD))


def _cut_in_place(run: Path, name: str, size: int) -> None:
    """Cut a file where it was appended to, which needs no space on a full disk."""
    file = open_descriptor_below(run, name, os.O_WRONLY)
    try:
        os.ftruncate(file, size)
        os.fsync(file)
    finally:
        os.close(file)
