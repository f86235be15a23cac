"""The refusal of a run folder that is not made of plain files and folders.

Run folders travel: evidence comes from strangers. Two rules keep every command inside the folder:

* `check_plain_contents`, whenever a run folder is opened: nothing in it is a link, pipe, device or socket. A
  path of fixed names below a checked folder therefore stays in it. This is enough for a folder that somebody
  sends. It cannot stop a process that changes the folder at the same time, but such a process has the user's
  permissions, and needs no links.
* `mutator._common.confined_files`, wherever a name comes from a file: the name is checked when it is joined.
"""

from fnmatch import fnmatchcase
from pathlib import Path

from mutator._common.confined_files import entries_below, is_file_or_folder, is_too_deep, not_plain_error
from mutator._common.library_and_run_folder_search import SCRATCH_FOLDER
from mutator.errors import UnsafePath
from mutator.store.allowed_contents import ALLOWED_FOLDERS, DAMAGED_FOLDER, TRACES_FOLDER

# what targets wrote, and what `verify --repair` set aside; nothing in them is reached by its name
_UNCHECKED_FOLDERS = (SCRATCH_FOLDER, DAMAGED_FOLDER, f"{TRACES_FOLDER}/*/{SCRATCH_FOLDER}")


def check_plain_contents(run: Path) -> None:
    """Raise UnsafePath for a link, a special file, an unprintable name, a file in place of a folder, folders
    nested too deeply, or two names that differ only in case.

    Folders that can contain anything only have to be folders.
    """
    tops: dict[str, str] = {}  # names in `run` itself
    for name, entry in entries_below(run, is_unchecked_folder):
        if not is_file_or_folder(entry):
            raise not_plain_error(Path(entry.path))
        if not entry.name.isprintable():
            raise _outside_error(f"the name {entry.name!a}", run, "names of printable characters")
        if is_too_deep(name):
            raise _outside_error("deeply nested folders", run, "few folders in each other")
        if name in ALLOWED_FOLDERS and not entry.is_dir():
            raise _outside_error("a file", Path(entry.path), "a folder")
        if "/" not in name and (before := tops.setdefault(name.casefold(), name)) != name:
            raise _outside_error(f"both {before!a} and {name!a}", run, "names that differ not only in case")


def is_unchecked_folder(name: str) -> bool:
    """Whether the folder of this name in a run folder can contain anything."""
    return any(
        fnmatchcase(name, pattern) and name.count("/") == pattern.count("/") for pattern in _UNCHECKED_FOLDERS
    )


def _outside_error(got: str, where: Path, expected: str) -> UnsafePath:
    return UnsafePath(
        got, where=where, expected=expected, remedy="rename or delete what does not belong here"
    )
