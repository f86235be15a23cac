"""Find out whether files were written to while somebody else could reach them."""

import os
from collections.abc import Mapping

_READ_FLAGS = os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
_FileState = tuple[int, int, int, int]


class FileChangeDetector:
    """Files that must stay as they are from now on: absolute path -> content.

    A changed file is found even if its bytes, size and times were put back, because only the kernel sets its
    ctime. Three things escape: a clock that root sets back, writes past the file system, and, on tmpfs, a
    write through a memory mapping that is undone before the comparison.
    """

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self._files = files
        self._states = {path: _state_at(path) for path in files}  # None for a file that is already missing

    def first_changed_path(self) -> str:
        """Return the path of a file that was changed, replaced or removed; empty if there is none."""
        return next((path for path in self._files if not self._is_unchanged(path)), "")

    def _is_unchanged(self, path: str) -> bool:
        try:
            file = os.open(path, _READ_FLAGS)
        except OSError:
            return False
        try:
            data = self._files[path]
            return _file_state(os.fstat(file)) == self._states[path] and os.read(file, len(data) + 1) == data
        except OSError:
            return False
        finally:
            os.close(file)


def _state_at(path: str) -> _FileState | None:
    try:
        return _file_state(os.lstat(path))
    except OSError:
        return None


def _file_state(state: os.stat_result) -> _FileState:
    return state.st_dev, state.st_ino, state.st_mode, state.st_ctime_ns
