"""Folders in the cache, written completely or not at all, and verified before use."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from mutator._common.bounded_reading import MOST_DATA, read_bounded
from mutator._common.confined_files import check_plain
from mutator._common.hashing import digest
from mutator.errors import Outside

_SUM = "sum"  # the file with the digest of all others


def fetch(place: Path, to: Path) -> None:
    """Replace the folder `to` with a copy of the cached folder `place`.

    OSError if the cached folder is missing or damaged.
    """
    shutil.rmtree(to, ignore_errors=True)
    shutil.copytree(place, to, symlinks=True)
    try:
        check_plain(to)
    except Outside as err:  # the copy of a link would be the file at its end
        raise OSError(str(err)) from None
    kept = to / _SUM
    said = read_bounded(kept)
    kept.unlink()
    if said != _sum(to):
        raise OSError(f"{place}: damaged")


def store(place: Path, fill: Callable[[Path], object]) -> None:
    """Let `fill` write a folder, and store it at `place`. Do nothing if the cache is unwritable."""
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=place.parent) as scratch:
            made = Path(scratch) / "entry"
            fill(made)
            (made / _SUM).write_bytes(_sum(made))
            shutil.rmtree(place, ignore_errors=True)  # the folder at `place` is missing or damaged
            made.rename(place)
    except OSError:
        return


def _sum(folder: Path) -> bytes:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    found = [(path, digest(read_bounded(path, MOST_DATA))) for path in files]
    return digest(sorted((path.relative_to(folder).as_posix(), one) for path, one in found)).encode()
