"""The trees in which an engine runs its jobs, made of a target's pristine files.

A run can write to every file of its user, also to trees of other runs, and put sizes and times back. So
nothing in a tree is shared: each engine compiles the bytecode itself, and writes trees of its own. After a
run, its tree is compared with what was laid out, byte for byte and by ctime, which shows what was changed and
put back. Writing a tree takes up to a fifth of a run's time, so an unchanged tree is used again. It is moved
to the next run, not linked: a link would change the ctime of every file. All this takes a third of the time
that an engine took before to link and delete a tree.
"""

import os
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib.machinery import all_suffixes
from itertools import count
from pathlib import Path

from mutator._common.files import clear_place, is_disk_full, remove_folder
from mutator._common.unchanged_files import UnchangedFiles
from mutator.engines import bytecode
from mutator.targets.source_tree import SourceTree

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


class BaseTree:
    """A target's files, with bytecode that this process compiled. The folder `work` has the unused trees."""

    def __init__(self, tree: SourceTree, work: Path) -> None:
        self._sources = tree.files
        self._files = bytecode.with_bytecode(tree)
        self._work = work
        self._unused: list[RunTree] = []  # threads share it, which `pop` and `append` allow
        self._numbers = count()

    def lay_out(self, place: Path, changed: Mapping[str, bytes], *, new: bool = False) -> RunTree:
        """Make a tree in `place`, with the files `changed`.

        With `new`, no earlier run has used it, and it has no bytecode that anybody could exchange.
        """
        place.parent.mkdir(parents=True, exist_ok=True)
        pristine = self._sources if new else self._files
        if new or not self._reused(place, changed):
            bytecode.write(pristine, place)
            bytecode.put(changed, place)
        stale = set(map(bytecode.bytecode_of, changed))
        files = {name: data for name, data in pristine.items() if name not in stale}
        return RunTree(place, {**files, **changed}, changed)

    def take_back(self, tree: RunTree) -> None:
        """Keep an unchanged tree, made pristine, for another run; leave one with new files."""
        if tree.added():
            return
        with suppress(OSError):
            bytecode.remove(tree.changed, tree.place)
            changed = {*tree.changed, *map(bytecode.bytecode_of, tree.changed)}
            bytecode.write({name: self._files[name] for name in changed & self._files.keys()}, tree.place)
            unused = self._work / f"{os.getpid()}-tree-{next(self._numbers)}"
            if tree.move(unused):
                self._unused.append(tree)

    def close(self) -> None:
        while self._unused:
            remove_folder(self._unused.pop().place)

    def _reused(self, place: Path, changed: Mapping[str, bytes]) -> bool:
        while self._unused:
            try:
                if self._unused.pop().move(place):
                    bytecode.put(changed, place)
                    return True
            except OSError as err:
                if is_disk_full(err):
                    raise
            clear_place(place)  # a run has deleted the tree, or put something else in its place
        return False


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
