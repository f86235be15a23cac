"""The trees in which an engine runs its jobs, made of a target's pristine files.

Nothing in a tree is shared: each engine compiles the bytecode itself, and writes trees of its own. Writing a
tree takes up to a fifth of a run's time, so a tree that its run left unchanged (`job_tree`) is used again. It
is moved to the next run, not linked: a link would change the ctime of every file. All this, with the search
for changes, takes a third of the time that an engine took before to link and delete a tree.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path

from mutator._common.files import is_disk_full_error, remove_anything_at, remove_folder
from mutator.engines import bytecode
from mutator.engines.job_tree import RunTree
from mutator.targets.source_tree import SourceTree


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
                if is_disk_full_error(err):
                    raise
            remove_anything_at(place)  # a run has deleted the tree, or put something else in its place
        return False
