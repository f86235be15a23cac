"""C libraries that do a part of a run's arithmetic: the same numbers, sooner. Nothing needs them.

They lie in a folder of the cache, each under a digest of what it was made of, so one that was made of
something else is never taken. `selfdrive.sim.compile_helpers` makes them; runs only look.
"""

import ctypes
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

FOLDER, SUFFIX = "compiled", ".so"
CHECK = 32  # bytes at a library's end: the digest of those before

_folder: Path | None = None


class Library(NamedTuple):
    """A library that was found, and the digest of its bytes."""

    path: Path
    digest: bytes


def use(cache: Path | None) -> None:
    """From now on look for libraries in this cache folder; None: do without."""
    global _folder
    _folder = None
    if cache is not None:
        try:
            folder = cache / FOLDER
            _folder = folder if any(folder.glob(f"*{SUFFIX}")) else None
        except OSError:  # a folder that nobody may look into
            return


def library(name: str, made_of: Callable[[], bytes]) -> Library | None:
    """The library `name` of what `made_of` stands for; None if there is none, or none is to be used.

    `made_of` is asked only where there may be one. One that is damaged, or cannot be loaded here as it was
    made with another C library, is none.
    """
    if _folder is None:
        return None
    path = _folder / file_name(name, made_of())
    if path.is_fifo():  # nobody waits for what a pipe may say
        return None
    try:
        data = path.read_bytes()
        digest = sha256(data[:-CHECK]).digest()
        if data[-CHECK:] != digest:
            return None
        ctypes.CDLL(str(path))
    except OSError:
        return None
    return Library(path, digest)


def file_name(name: str, made_of: bytes) -> str:
    """What a library's file is called."""
    return f"{name}-{sha256(made_of).hexdigest()[:32]}{SUFFIX}"
