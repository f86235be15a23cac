"""The trees in which an engine runs its jobs, made of a target's pristine files.

Nothing in a tree is shared: each process compiles the bytecode itself, when its first tree is laid out, and
writes trees of its own. No bytecode is kept for later commands: a mutant could exchange it. Writing a
tree takes up to a fifth of a run's time, so a tree that its run left unchanged (`job_tree`) is used again. It
is moved to the next run, not linked: a link would change the ctime of every file. All this, with the search
for changes, takes a third of the time that an engine took before to link and delete a tree.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from itertools import count
from pathlib import Path
from threading import Lock

from mutator._common.files import is_disk_full_error, remove_anything_at, remove_folder
from mutator.engines import pyc_files
from mutator.engines.job_tree import JobTree
from mutator.targets.source_tree import SourceTree


class JobTreePool:
    """A target's files, with bytecode that this process compiled of what the `entry_module` imports.

    Unused trees wait in `work_folder`.
    """

    def __init__(self, tree: SourceTree, work_folder: Path, entry_module: str) -> None:
        self._source_tree = tree
        self._entry_module = entry_module
        self._files_with_bytecode: Mapping[str, bytes] = {}  # empty until a tree needs it
        self._compile_lock = Lock()
        self._work_folder = work_folder
        self._unused_trees: list[JobTree] = []  # threads share it, which `pop` and `append` allow
        self._tree_numbers = count()

    def lay_out_tree(
        self, folder: Path, changed_files: Mapping[str, bytes], *, fresh: bool = False
    ) -> JobTree:
        """Make a tree in `folder`, with the `changed_files`.

        With `fresh`, no earlier run has used it, and it has no bytecode that anybody could exchange.
        """
        folder.parent.mkdir(parents=True, exist_ok=True)
        pristine = self._source_tree.files if fresh else self._compiled_files()
        if fresh or not self._reuse_tree(folder, changed_files):
            pyc_files.write_files(pristine, folder)
            pyc_files.replace_dropping_bytecode(changed_files, folder)
        stale = set(map(pyc_files.bytecode_path, changed_files))
        files = {name: data for name, data in pristine.items() if name not in stale}
        return JobTree(folder, {**files, **changed_files}, changed_files)

    def take_back_tree(self, tree: JobTree) -> None:
        """Keep an unchanged tree, made pristine, for another run; leave one with new files."""
        if tree.added_paths():
            return
        with suppress(OSError):
            pyc_files.remove_files(tree.changed_files, tree.folder)
            changed_names = {*tree.changed_files, *map(pyc_files.bytecode_path, tree.changed_files)}
            pyc_files.write_files(
                {
                    name: self._files_with_bytecode[name]
                    for name in changed_names & self._files_with_bytecode.keys()
                },
                tree.folder,
            )
            unused = self._work_folder / f"{os.getpid()}-tree-{next(self._tree_numbers)}"
            if tree.move_to(unused):
                self._unused_trees.append(tree)

    def close(self) -> None:
        while self._unused_trees:
            remove_folder(self._unused_trees.pop().folder)

    def _compiled_files(self) -> Mapping[str, bytes]:
        with self._compile_lock:
            if not self._files_with_bytecode:
                self._files_with_bytecode = pyc_files.files_with_bytecode(
                    self._source_tree, self._entry_module
                )
            return self._files_with_bytecode

    def _reuse_tree(self, folder: Path, changed_files: Mapping[str, bytes]) -> bool:
        while self._unused_trees:
            try:
                if self._unused_trees.pop().move_to(folder):
                    pyc_files.replace_dropping_bytecode(changed_files, folder)
                    return True
            except OSError as err:
                if is_disk_full_error(err):
                    raise
            remove_anything_at(folder)  # a run has deleted the tree, or put something else in its place
        return False
