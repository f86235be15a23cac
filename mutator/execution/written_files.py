"""What the workers of a session wrote, compared before it counts. A mutant can write to these files, too."""

import hashlib
from collections.abc import Mapping
from pathlib import Path

from mutator._common.confined_files import open_below, read_below, unlink_below, write_below
from mutator._common.files import raising_disk_full
from mutator.store import file_digests

ASIDE = "damaged"
Sums = Mapping[str, str]  # SHA-256 by the name of a file of lines in the run folder


class WrittenFiles:
    """Files of lines that the workers of a session wrote, with the digests that the workers reported."""

    def __init__(self) -> None:
        self._sums: dict[str, str] = {}
        self._unreported: set[str] = set()

    def begin(self, worker: str) -> None:
        """Note that a process began to work. Its files are believed until it reports, so that work is kept
        when the process dies or the command is interrupted.
        """
        self._unreported.add(worker)

    def report(self, sums: Sums, worker: str = "") -> None:
        """Add what a worker wrote. `worker` names one that began in another process."""
        self._sums |= sums
        self._unreported.discard(worker)

    def set_others_aside(self, run: Path) -> list[str]:
        """Move new files of lines that no worker wrote so to `damaged/`; return their names."""
        known = file_digests.load_ledger(run).files
        found = [name for name in file_digests.list_segments(run) if name not in known]
        lost = [name for name in self._sums if name not in found]
        others = [name for name in found if not self._is_as_written(run, name)]
        with raising_disk_full(run):
            for name in others:
                write_below(run, f"{ASIDE}/{name}", read_below(run, name))
                unlink_below(run, name)
        return [*others, *lost]

    def _is_as_written(self, run: Path, name: str) -> bool:
        if Path(name).stem in self._unreported:
            return True
        with open_below(run, name) as file:
            return hashlib.file_digest(file, "sha256").hexdigest() == self._sums.get(name)
