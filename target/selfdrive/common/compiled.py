"""C libraries that do a part of a run's arithmetic: the same numbers, sooner. Nothing needs them.

A C file names the Python files beside it that it stands for: `Stands for: hog.py, mark_edges.py.` The name of
its library has a digest of all of these, so where one of them is edited there is no library, and the Python
calculates. `selfdrive.sim.compile_helpers` makes libraries; runs only look for them.
"""

import ctypes
import re
import sysconfig
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

SUFFIX = f".{sysconfig.get_platform()}.so"
CHECK = 32  # bytes at a library's end: the digest of those before
_STANDS_FOR = re.compile(rb"Stands for: ([\w./, ]+)\.$", re.MULTILINE)

_folder: Path | None = None


class Library(NamedTuple):
    """A library that was found: its functions, and the digest of its bytes."""

    code: ctypes.CDLL
    digest: bytes


def use(folder: Path | None) -> None:
    """From now on look for libraries in this folder; None: do without."""
    global _folder
    _folder = None
    if folder is not None:
        try:
            _folder = folder if any(folder.glob(f"*{SUFFIX}")) else None
        except OSError:  # a folder that nobody may look into
            return


def library(source: Path) -> Library | None:
    """The library of the C file `source`; None if there is none, or none is to be used.

    One that is damaged, or cannot be loaded here as it was made with another C library, is none.
    """
    if _folder is None:
        return None
    try:
        return _loaded(_folder / file_name(source))
    except OSError:
        return None


def file_name(source: Path) -> str:
    """What the library of the C file `source` is called. Raises OSError for a file that cannot be read."""
    text = source.read_bytes()
    digest = sha256(text)
    for name in stands_for(text):
        digest.update(sha256((source.parent / name).read_bytes()).digest())
    return f"{source.stem}-{digest.hexdigest()[:32]}{SUFFIX}"


def stands_for(text: bytes) -> list[str]:
    """Paths, from the C file's folder, of the Python files that its text says it stands for."""
    found = _STANDS_FOR.search(text)
    return found[1].decode().split(", ") if found else []


@cache
def _loaded(path: Path) -> Library | None:
    if path.is_fifo():  # nobody waits for what a pipe may say
        return None
    data = path.read_bytes()
    digest = sha256(data[:-CHECK]).digest()
    return Library(ctypes.CDLL(str(path)), digest) if data[-CHECK:] == digest else None
