"""The tree of one run, and what the run changed in it.

A run can write to every file of its user, also to trees of other runs, and put sizes and times back. After a
run, its tree is therefore compared with what was laid out, byte for byte and by ctime, which shows what was
changed and put back.
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.machinery import all_suffixes
from pathlib import Path

from mutator._common.file_change_detection import FileChangeDetector

_IMPORTABLE_SUFFIXES = tuple(all_suffixes())


class JobTree:
    """The tree of one run in `folder`: a pristine tree, but for the `changed_files` of a mutant."""

    def __init__(self, place: Path, files: Mapping[str, bytes], changed_files: Mapping[str, bytes]) -> None:
        self.folder = place
        self.changed_files = changed_files
        self._expected_names_by_folder: dict[str, set[str]] = {}  # names by folder
        for name in files:
            while name:  # each folder on the way must hold the next one
                folder, _, last = name.rpartition("/")
                self._expected_names_by_folder.setdefault(folder, set()).add(last)
                name = folder
        self._inodes_by_folder = {
            folder: _inode_number(place / folder) for folder in self._expected_names_by_folder
        }
        self._files = FileChangeDetector({f"{place}/{name}": data for name, data in files.items()})

    def first_changed_path(self) -> str:
        """Return a file that was changed, removed, or added where an import finds it; empty if none was."""
        if path := self._files.first_changed_path() or self._first_replaced_folder():
            return path.removeprefix(f"{self.folder}/")
        imported = (
            name
            for path in self.added_paths()
            for name in _files_below(path)
            if name.endswith(_IMPORTABLE_SUFFIXES)
        )
        return next(imported, "").removeprefix(f"{self.folder}/")

    def added_paths(self) -> list[Path]:
        """Return the new files and folders, without what is in the latter."""
        paths = []
        for folder, names in self._expected_names_by_folder.items():
            with suppress(OSError), os.scandir(self.folder / folder) as entries:
                paths += [Path(entry.path) for entry in entries if entry.name not in names]
        return paths

    def move_to(self, place: Path) -> bool:
        """Move the tree; return whether its folders are still the same, and no links in their place."""
        self.folder = self.folder.rename(place)
        return not self._first_replaced_folder()

    def _first_replaced_folder(self) -> str:
        for folder, number in self._inodes_by_folder.items():
            if not number or _inode_number(self.folder / folder) != number:
                return f"{self.folder}/{folder}"
        return ""


def _inode_number(folder: Path) -> int:
    """Return the number of a folder's inode; 0 if it is missing."""
    try:
        return os.lstat(folder).st_ino
    except OSError:
        return 0


def _files_below(path: Path) -> Iterator[str]:
    if path.is_symlink() or not path.is_dir():
        yield str(path)
        return
    for folder, _, names in os.walk(path):
        yield from (f"{folder}/{name}" for name in names)
