"""A target's pristine tree. Runs link to its files, because copying takes up to a tenth of a run's time."""

import os
import shutil
from pathlib import Path

from mutator._common.files import is_disk_full

_Stamp = tuple[int, int, int, int]


class BaseTree:
    """The pristine tree in `folder`, made by `prepare_base`.

    A run can write through its links and so change this tree. The engine then restores the tree, and repeats
    each run that was made in the meantime, on a copy without links.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._files = {path: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}
        self._stamps = self._look()

    def lay_out(self, tree: Path, *, linked: bool) -> None:
        if linked:
            shutil.copytree(self._folder, tree, copy_function=_link_or_copy)
            return
        for path, data in self._files.items():
            place = tree / path.relative_to(self._folder)
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(data)

    def was_changed(self) -> bool:
        """Restore changed files; return whether a file was changed or restored since the last call."""
        if (stamps := self._look()) == self._stamps:
            return False
        for path in self._files:
            if stamps[path] != self._stamps[path] and not self._is_pristine(path):
                self._mend(path)
        self._stamps = self._look()
        return True

    def _is_pristine(self, path: Path) -> bool:
        try:
            return path.read_bytes() == self._files[path] and path.stat().st_mode == self._stamps[path][0]
        except OSError:
            return False

    def _mend(self, path: Path) -> None:
        """Replace the file atomically, because another process can be linking to it."""
        whole = self._folder.with_name(f"{self._folder.name}-mended.{os.getpid()}")
        whole.write_bytes(self._files[path])
        whole.chmod(self._stamps[path][0])
        whole.replace(path)

    def _look(self) -> dict[Path, _Stamp]:
        states = {path: path.stat() for path in self._files}
        return {path: (s.st_mode, s.st_mtime_ns, s.st_size, s.st_ino) for path, s in states.items()}


def _link_or_copy(source: str, dest: str) -> None:
    try:
        os.link(source, dest)
    except OSError as err:
        if is_disk_full(err):
            raise
        shutil.copyfile(source, dest)
