"""Optional compiled C libraries that replace Python calculations: same numbers, but faster.

A C file lists the Python files that it replaces: `Stands for: hog.py, mark_edges.py.` The library's name
contains a digest of all of these. After an edit of one of them, Python is used until
`selfdrive.sim.compile_helpers` rebuilds the library.
"""

import ctypes
import re
import sysconfig
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

SUFFIX = f".{sysconfig.get_platform()}.so"
CHECK = 32  # bytes of the digest at a library's end
_STANDS_FOR = re.compile(rb"Stands for: ([\w./, ]+)\.$", re.MULTILINE)

_folder: Path | None = None


class Library(NamedTuple):
    code: ctypes.CDLL
    digest: bytes


def use_libraries_in(folder: Path | None) -> None:
    """Look for libraries in this folder from now on; None: use none."""
    global _folder
    _folder = None
    if folder is not None:
        try:
            _folder = folder if any(folder.glob(f"*{SUFFIX}")) else None
        except OSError:  # unreadable folder
            return


def library(source: Path) -> Library | None:
    """Return the library of the C file `source`; None if it is missing, damaged, disabled or not loadable."""
    if _folder is None:
        return None
    try:
        return _loaded(_folder / file_name(source))
    except OSError:
        return None


def file_name(source: Path) -> str:
    """Return the name of the library of the C file `source`. Raises OSError for an unreadable file."""
    text = source.read_bytes()
    digest = sha256(text)
    for name in stands_for(text):
        digest.update(sha256((source.parent / name).read_bytes()).digest())
    return f"{source.stem}-{digest.hexdigest()[:32]}{SUFFIX}"


def stands_for(text: bytes) -> list[str]:
    """Return the paths, relative to the C file, of the Python files that it replaces."""
    found = _STANDS_FOR.search(text)
    return found[1].decode().split(", ") if found else []


@cache
def _loaded(path: Path) -> Library | None:
    if path.is_fifo():  # reading a pipe would block
        return None
    data = path.read_bytes()
    digest = sha256(data[:-CHECK]).digest()
    return Library(ctypes.CDLL(str(path)), digest) if data[-CHECK:] == digest else None
