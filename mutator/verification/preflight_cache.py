"""Checks that passed on this machine, kept for other run folders of the same sources, golden runs included.

Entries are found by what they depend on, made whole or not at all, and looked at before they are believed;
anything in here can be deleted at any time.
"""

import os
import platform
import shutil
import tempfile
from pathlib import Path

from mutator._common.hashing import digest


def entry(key: str) -> Path:
    """Where the checks of this digest are kept: below XDG_CACHE_HOME, or ~/.cache. Another machine with
    the same home has entries of its own, for its processor may reckon otherwise."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    base = named if named.is_absolute() else Path("~/.cache").expanduser()
    return base / "mutator" / "checks" / digest([key, platform.node(), platform.processor()])


def copy(source: Path, to: Path, file: str) -> None:
    """Copy golden runs and results (`file`, last) from one folder into another."""
    shutil.rmtree(to / "golden", ignore_errors=True)
    shutil.copytree(source / "golden", to / "golden")
    shutil.copy(source / file, to / file)


def store(place: Path, run: Path, file: str) -> None:
    """Keep a run folder's passed checks at `place`. An unwritable cache is ignored."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=place.parent) as scratch:
            made = Path(scratch) / "entry"
            made.mkdir()
            copy(run, made, file)
            shutil.rmtree(place, ignore_errors=True)  # it was not there, or was not believed
            made.rename(place)
    except OSError:
        return
