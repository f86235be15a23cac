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

from mutator._common.file_change_detection import UnchangedFiles

_IMPORTED = tuple(all_suffixes())


class RunTree:
    """The tree of one run in `place`: the files of a base tree, some of them `changed` by a mutant."""

    def __init__(self, place: Path, files: Mapping[str, bytes], changed: Mapping[str, bytes]) -> None:
        self.place = place
        self.changed = changed
        self._expected: dict[str, set[str]] = {}  # names by folder
        for name in files:
            while name:
                folder, _, last = name.rpartition("/")
                self._expected.setdefault(folder, set()).add(last)
                name = folder
        self._folders = {folder: _number(place / folder) for folder in self._expected}
        self._files = UnchangedFiles({f"{place}/{name}": data for name, data in files.items()})

    def first_changed(self) -> str:
        """Return a file that was changed, removed, or added where an import finds it; empty if none was."""
        if path := self._files.first_changed() or self._first_moved():
            return path.removeprefix(f"{self.place}/")
        imported = (name for path in self.added() for name in _files(path) if name.endswith(_IMPORTED))
        return next(imported, "").removeprefix(f"{self.place}/")

    def added(self) -> list[Path]:
        """Return the new files and folders, without what is in the latter."""
        found = []
        for folder, names in self._expected.items():
            with suppress(OSError), os.scandir(self.place / folder) as entries:
                found += [Path(entry.path) for entry in entries if entry.name not in names]
        return found

    def move(self, place: Path) -> bool:
        """Move the tree; return whether its folders are still the same, and no links in their place."""
        self.place = self.place.rename(place)
        return not self._first_moved()

    def _first_moved(self) -> str:
        for folder, number in self._folders.items():
            if not number or _number(self.place / folder) != number:
                return f"{self.place}/{folder}"
        return ""


def _number(folder: Path) -> int:
    """Return the number of a folder's inode; 0 if it is missing."""
    try:
        return os.lstat(folder).st_ino
    except OSError:
        return 0


def _files(path: Path) -> Iterator[str]:
    if path.is_symlink() or not path.is_dir():
        yield str(path)
        return
    for folder, _, names in os.walk(path):
        yield from (f"{folder}/{name}" for name in names)
