"""The shipped controller, fault library and templates.

A clone has them next to the package. A wheel has them in an archive, because pip would compile a target's
sources and make `selfdrive` importable. The archive is unpacked once into $XDG_DATA_HOME or ~/.local/share.
"""

import os
import shutil
import tempfile
from functools import lru_cache
from pathlib import Path
from zipfile import ZipFile

from mutator._common.hashing import digest
from mutator.errors import MutatorError

ARCHIVE = Path(__file__).with_name("shipped.zip")  # created by setup.py; not in a clone
CLONE = Path(__file__).resolve().parents[2]
SHIPPED_TARGET = "shipped:target"  # value of `root` in a manifest
_README = Path(__file__).with_name("new_library.md")
_ROOT_IN_CLONE = "root: ../../target\n"
_SHOWN = 3  # the maximum number of changed files that an error names


def shipped_folder() -> Path:
    """Return the folder that holds the shipped target/, fault_library/ and templates/.

    Once per process, the unpacked files are compared with the archive. MutatorError if they differ or cannot
    be unpacked.
    """
    return _unpacked(ARCHIVE, _home()) if ARCHIVE.exists() else CLONE


def refuse_shipped(path: Path) -> None:
    """Raise MutatorError if `path`, which is about to be written, is in the unpacked archive."""
    if ARCHIVE.exists() and path.absolute().is_relative_to(_home()):
        raise MutatorError(
            "part of the library that ships with mutator, which must not change",
            where=path,
            expected="your own library",
            remedy="make one with `mutator init DIR`, then work in DIR",
        )


def write_library(folder: Path) -> None:
    """Write an editable library, templates and a README into a new or empty `folder`; MutatorError otherwise.

    The library's manifest says `root: shipped:target`, so the library works in any folder.
    """
    shipped = shipped_folder()
    make_empty(folder)
    for name in ("fault_library", "templates"):
        shutil.copytree(shipped / name, folder / name, ignore=shutil.ignore_patterns(".*"))
    for manifest in (folder / "fault_library" / "targets").glob("*.yaml"):
        text = manifest.read_text(encoding="utf-8")
        manifest.write_text(text.replace(_ROOT_IN_CLONE, f"root: {SHIPPED_TARGET}\n"), encoding="utf-8")
    shutil.copyfile(_README, folder / "README.md")


def make_empty(folder: Path) -> None:
    """Create a folder, or check that it is empty; MutatorError otherwise."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        problem = f"not empty ({sorted(folder.iterdir())[0].name})" if any(folder.iterdir()) else ""
    except OSError as err:
        problem = f"cannot be created ({err.strerror})"
    if problem:
        raise MutatorError(
            problem,
            where=folder,
            expected="a new or empty folder to write a library into",
            remedy="choose another DIR",
        )


def _home() -> Path:
    named = Path(os.environ.get("XDG_DATA_HOME", ""))
    base = named if named.is_absolute() else Path("~/.local/share").expanduser()
    return base / "mutator" / "shipped"


@lru_cache(maxsize=1)
def _unpacked(archive: Path, home: Path) -> Path:
    folder = home / digest(archive.read_bytes())[:16]
    if not folder.is_dir():
        _unpack(archive, folder)
    if changed := _changed(archive, folder):
        more = f" and {len(changed) - _SHOWN} more" if len(changed) > _SHOWN else ""
        raise MutatorError(
            f"changed since installation: {', '.join(changed[:_SHOWN])}{more}",
            where=folder,
            expected="the files that were installed with mutator, unedited",
            remedy="delete this folder to unpack it again; edit a library made by `mutator init DIR` instead",
        )
    return folder


def _unpack(archive: Path, folder: Path) -> None:
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".", dir=folder.parent) as scratch:
            whole = Path(scratch) / "whole"
            with ZipFile(archive) as file:
                file.extractall(whole)
            whole.rename(folder)
    except OSError as err:
        if folder.is_dir():
            return  # another process was faster
        raise MutatorError(
            f"cannot unpack the files that ship with mutator ({err.strerror})",
            where=folder,
            expected="a data folder that you can write to",
            remedy="set XDG_DATA_HOME to a writable folder, or work in a clone",
        ) from None


def _changed(archive: Path, folder: Path) -> list[str]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    found = {path.relative_to(folder).as_posix(): path for path in files}
    with ZipFile(archive) as file:
        names = set(file.namelist())
        same = {n for n in names & found.keys() if found[n].read_bytes() == file.read(n)}
    return sorted((names | found.keys()) - same)
