"""Files that appear in the machine's shared folders during a run, outside the limit on its disk space.

Which process made a file is not recorded anywhere, so it can also be another program of this user. Small
files are not named, because such programs make them all the time.
"""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from mutator.engines.in_target import process_guard

FOLDERS = (Path("/tmp"), Path("/dev/shm"))
_OURS = "mutator-"
_LISTED = 3
_LEAST = 1 << 20  # bytes on the disk


class LeftFiles:
    """Compares the shared folders with their state when this object was made."""

    def __init__(self, folders: Sequence[Path] = FOLDERS) -> None:
        self._folders = folders
        self._before = {*self._names()}

    def remark(self) -> str:
        """Return a sentence about large new files and folders of this user; empty if there are none."""
        new = [path for path in self._names() if path not in self._before and _size(path) >= _LEAST]
        if not new:
            return ""
        more = f" and {len(new) - _LISTED} more" if len(new) > _LISTED else ""
        return (
            f"new in shared folders during this run: {', '.join(new[:_LISTED])}{more}; if mutants made them, "
            "they are outside the limit on disk space, and later runs can find them"
        )

    def _names(self) -> list[str]:
        found = []
        for folder in self._folders:
            with suppress(OSError), os.scandir(folder) as entries:
                for entry in entries:
                    with suppress(OSError):
                        owner = entry.stat(follow_symlinks=False).st_uid
                        if owner == os.getuid() and not entry.name.startswith(_OURS):
                            found.append(entry.path)
        return sorted(found)


def _size(path: str) -> int:
    with suppress(OSError):
        return os.lstat(path).st_blocks * 512 + process_guard.used(path)
    return 0
