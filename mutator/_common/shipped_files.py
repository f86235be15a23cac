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

SHIPPED_ARCHIVE_PATH = Path(__file__).with_name("shipped.zip")  # created by setup.py; not in a clone
CLONE_FOLDER = Path(__file__).resolve().parents[2]
SHIPPED_TARGET_ROOT = "shipped:target"  # value of `root` in a manifest
_LIBRARY_README_PATH = Path(__file__).with_name("new_library.md")
_MANIFEST_ROOT_LINE_IN_CLONE = "root: ../../target\n"
_MOST_NAMED_FILES = 3  # the maximum number of changed files that an error names


def shipped_folder() -> Path:
    """Return the folder that holds the shipped target/, fault_library/ and templates/.

    Once per process, the unpacked files are compared with the archive. MutatorError if they differ or cannot
    be unpacked.
    """
    return (
        _checked_unpacked_folder(SHIPPED_ARCHIVE_PATH, _unpacked_archives_folder())
        if SHIPPED_ARCHIVE_PATH.exists()
        else CLONE_FOLDER
    )


def check_not_shipped(path: Path) -> None:
    """Raise MutatorError if `path`, which is about to be written, is in the unpacked archive."""
    if SHIPPED_ARCHIVE_PATH.exists() and path.absolute().is_relative_to(_unpacked_archives_folder()):
        raise MutatorError(
            "part of the library that ships with mutator, which must not change",
            where=path,
            expected="your own library",
            remedy="make one with `mutator init DIR`, then work in DIR",
        )


def write_new_library(folder: Path) -> None:
    """Write an editable library, templates and a README into a new or empty `folder`; MutatorError otherwise.

    The library's manifest says `root: shipped:target`, so the library works in any folder.
    """
    shipped = shipped_folder()
    make_empty_folder(folder)
    for name in ("fault_library", "templates"):
        shutil.copytree(shipped / name, folder / name, ignore=shutil.ignore_patterns(".*"))
    for manifest in (folder / "fault_library" / "targets").glob("*.yaml"):
        text = manifest.read_text(encoding="utf-8")
        manifest.write_text(
            text.replace(_MANIFEST_ROOT_LINE_IN_CLONE, f"root: {SHIPPED_TARGET_ROOT}\n"), encoding="utf-8"
        )
    shutil.copyfile(_LIBRARY_README_PATH, folder / "README.md")


def make_empty_folder(folder: Path) -> None:
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
            remedy="choose another `folder`",
            argument="folder",
        )


def _unpacked_archives_folder() -> Path:
    named = Path(os.environ.get("XDG_DATA_HOME", ""))
    base = named if named.is_absolute() else Path("~/.local/share").expanduser()
    return base / "mutator" / "shipped"


@lru_cache(maxsize=1)
def _checked_unpacked_folder(archive: Path, home: Path) -> Path:
    # a folder for each content: processes of an older version may still read theirs
    folder = home / digest(archive.read_bytes())[:16]
    if not folder.is_dir():
        _unpack(archive, folder)
    if changed := _changed_files(archive, folder):
        more = f" and {len(changed) - _MOST_NAMED_FILES} more" if len(changed) > _MOST_NAMED_FILES else ""
        raise MutatorError(
            f"changed since installation: {', '.join(changed[:_MOST_NAMED_FILES])}{more}",
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


def _changed_files(archive: Path, folder: Path) -> list[str]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    unpacked_files = {path.relative_to(folder).as_posix(): path for path in files}
    with ZipFile(archive) as file:
        names = set(file.namelist())
        same = {n for n in names & unpacked_files.keys() if unpacked_files[n].read_bytes() == file.read(n)}
    return sorted((names | unpacked_files.keys()) - same)
