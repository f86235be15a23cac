"""Checks that passed on this machine, with their golden runs, for other run folders of the same sources."""

import platform
import shutil
from pathlib import Path

from mutator._common import caches, kept_folders
from mutator._common.hashing import digest
from mutator.verification.unreached import FOLDER


def entry(key: str) -> Path:
    """Where the checks with this digest are kept. Machines that share a home folder have separate entries:
    the digest may not cover everything that changes last digits."""
    return caches.of_checks() / digest([key, platform.node()])


def store(place: Path, run: Path, file: str, observed: Path) -> None:
    """Keep a run folder's golden runs and check results (`file`) at `place`, with what is `observed`; an
    unwritable cache is ignored."""

    def fill(made: Path) -> None:
        shutil.copytree(run / "golden", made / "golden")
        shutil.copy(run / file, made / file)
        if (observed / FOLDER).is_dir():
            shutil.copytree(observed / FOLDER, made / FOLDER)

    kept_folders.store(place, fill)
