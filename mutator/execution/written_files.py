"""What the workers of a session wrote, compared before it counts. A mutant can write to these files, too."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from mutator._common.confined_files import open_below, read_below, unlink_below, write_below
from mutator._common.files import raising_disk_full
from mutator.store import file_digests

DAMAGED_FOLDER = "damaged"
FileDigests = Mapping[str, str]  # SHA-256 by the name of a file of lines in the run folder


class WrittenFiles:
    """Files of lines that the workers of a session wrote, with the digests that the workers reported."""

    def __init__(self) -> None:
        self._digests_by_file: dict[str, str] = {}
        self._unreported_workers: set[str] = set()

    def note_worker_began(self, worker: str) -> None:
        """Note that a process began to work. Its files are believed until it reports, so that work is kept
        when the process dies or the command is interrupted.
        """
        self._unreported_workers.add(worker)

    def add_report(self, digests_by_file: FileDigests, worker: str = "") -> None:
        """Add what a worker wrote. `worker` names one that began in another process."""
        self._digests_by_file |= digests_by_file
        self._unreported_workers.discard(worker)

    def set_unreported_aside(self, run: Path) -> list[str]:
        """Move new files of lines that no worker wrote so to `damaged/`; return their names."""
        earlier_files = file_digests.load_ledger(run).files
        new_files = [name for name in file_digests.list_segments(run) if name not in earlier_files]
        lost = [name for name in self._digests_by_file if name not in new_files]
        others = [name for name in new_files if not self._is_as_reported(run, name)]
        with raising_disk_full(run):
            for name in others:
                write_below(run, f"{DAMAGED_FOLDER}/{name}", read_below(run, name))
                unlink_below(run, name)
        return [*others, *lost]

    def _is_as_reported(self, run: Path, name: str) -> bool:
        if Path(name).stem in self._unreported_workers:
            return True
        with open_below(run, name) as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == self._digests_by_file.get(name)
