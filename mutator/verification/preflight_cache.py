"""Checks that passed on this machine, kept for other run folders of the same sources, golden runs included.

Entries are found by what they depend on, written whole or not at all, and verified before they are used. An
unwritable or damaged cache is ignored; any entry may be deleted at any time.
"""

import platform
import shutil
import tempfile
from pathlib import Path

from mutator._common import caches
from mutator._common.hashing import digest


def entry(key: str) -> Path:
    """Where the checks with this digest are kept. Each machine that shares the home has entries of its own:
    what its digest says of it may not be all that changes last digits."""
    return caches.of_checks() / digest([key, platform.node()])


def copy(source: Path, to: Path, file: str) -> None:
    """Copy golden runs and results (`file`, last) from one folder into another."""
    shutil.rmtree(to / "golden", ignore_errors=True)
    shutil.copytree(source / "golden", to / "golden")
    shutil.copy(source / file, to / file)


def store(place: Path, run: Path, file: str) -> None:
    """Keep a run folder's passed checks at `place`; an unwritable cache is ignored."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=place.parent) as scratch:
            made = Path(scratch) / "entry"
            made.mkdir()
            copy(run, made, file)
            shutil.rmtree(place, ignore_errors=True)  # it was not there, or was damaged
            made.rename(place)
    except OSError:
        return
