"""Folders in the cache, written completely or not at all, and verified before use."""

import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path

from mutator._common.bounded_reading import MOST_EXPERIMENT_DATA_BYTES, read_bounded
from mutator._common.confined_files import check_only_plain_files
from mutator._common.hashing import digest
from mutator.errors import UnsafePath

_DIGEST_FILE = "sum"  # the file with the digest of all others


def copy_from_cache(cached: Path, copy: Path) -> None:
    """Replace the folder `copy` with a copy of the folder `cached`.

    OSError if the cached folder is missing or damaged.
    """
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(cached, copy, symlinks=True)
    try:
        check_only_plain_files(copy)
    except UnsafePath as err:  # the copy of a link would be the file at its end
        raise OSError(str(err)) from None
    digest_path = copy / _DIGEST_FILE
    expected_digest = read_bounded(digest_path)
    digest_path.unlink()
    if expected_digest != _digest_of_files(copy):
        raise OSError(f"{cached}: damaged")


def store_in_cache(cached: Path, fill: Callable[[Path], object]) -> None:
    """Let `fill` write a folder, and store it at `cached`. Do nothing if the cache is unwritable."""
    try:
        cached.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=cached.parent) as scratch:
            unfinished = Path(scratch) / "entry"
            fill(unfinished)
            (unfinished / _DIGEST_FILE).write_bytes(_digest_of_files(unfinished))
            shutil.rmtree(cached, ignore_errors=True)  # the folder there is missing or damaged
            unfinished.rename(cached)
    except OSError:
        return


def _digest_of_files(folder: Path) -> bytes:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    digests = [(path, digest(read_bounded(path, MOST_EXPERIMENT_DATA_BYTES))) for path in files]
    return digest(
        sorted((path.relative_to(folder).as_posix(), file_digest) for path, file_digest in digests)
    ).encode()
