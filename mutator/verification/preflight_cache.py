"""Checks that passed on this machine, kept for other run folders of the same sources, golden runs included.

Entries are found by what they depend on, written whole or not at all, and verified before they are used. An
unwritable or damaged cache is ignored; any entry may be deleted at any time.
"""

import platform
import shutil
import tempfile
from pathlib import Path

from mutator._common import caches
from mutator._common.files import no_pipe
from mutator._common.hashing import digest
from mutator.verification.unreached import FOLDER

_SUM = "sum"  # the file with the digest of all others of an entry


def entry(key: str) -> Path:
    """Where the checks with this digest are kept. Each machine that shares the home has entries of its own:
    what its digest says of it may not be all that changes last digits."""
    return caches.of_checks() / digest([key, platform.node()])


def fetch(place: Path, to: Path, file: str) -> None:
    """Copy the entry at `place`. OSError where there is none, or none that is as it was written."""
    copy(place, to, file)
    if no_pipe(place / _SUM).read_bytes() != _sum(to, file):
        raise OSError(f"{place}: not as it was written")


def copy(source: Path, to: Path, file: str) -> None:
    """Copy golden runs and results (`file`, last) from one folder into another."""
    shutil.rmtree(to / "golden", ignore_errors=True)
    to.mkdir(parents=True, exist_ok=True)
    shutil.copytree(source / "golden", to / "golden")
    shutil.copy(source / file, to / file)
    copy_observed(source, to)


def copy_observed(source: Path, to: Path) -> None:
    """Copy what golden runs observed, where that is kept."""
    shutil.rmtree(to / FOLDER, ignore_errors=True)
    if (source / FOLDER).is_dir():
        shutil.copytree(source / FOLDER, to / FOLDER)


def store(place: Path, run: Path, file: str, observed: Path) -> None:
    """Keep a run folder's passed checks at `place`, with what is `observed`; an unwritable cache is
    ignored."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=place.parent) as scratch:
            made = Path(scratch) / "entry"
            copy(run, made, file)
            copy_observed(observed, made)
            (made / _SUM).write_bytes(_sum(made, file))
            shutil.rmtree(place, ignore_errors=True)  # it was not there, or was damaged
            made.rename(place)
    except OSError:
        return


def _sum(folder: Path, file: str) -> bytes:
    """Digest of the names and contents of golden runs, of what they observed, and of results."""
    kept = (path for kind in ("golden", FOLDER) for path in (folder / kind).rglob("*"))
    files = [folder / file, *(path for path in kept if path.is_file())]
    found = sorted((path.relative_to(folder).as_posix(), digest(path.read_bytes())) for path in files)
    return digest(found).encode()
