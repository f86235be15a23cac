"""Files that appear in the machine's shared folders during a run, outside the limit on its disk space.

Which process made a file is not recorded anywhere, so it can also be another program of this user. Small
files are not named, because such programs make them all the time.
"""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from mutator.engines.in_target import process_guard

SHARED_FOLDERS = (Path("/tmp"), Path("/dev/shm"))
_HARNESS_PREFIX = "mutator-"
_MOST_LISTED_PATHS = 3  # the remark is one line
_MIN_REPORTED_BYTES = 1 << 20  # bytes on the disk


class StrayFiles:
    """Compares the shared folders with their state when this object was made."""

    def __init__(self, folders: Sequence[Path] = SHARED_FOLDERS) -> None:
        self._folders = folders
        self._paths_before = {*self._list_paths()}

    def remark_on_new_files(self) -> str:
        """Return a sentence about large new files and folders of this user; empty if there are none."""
        new = [
            path
            for path in self._list_paths()
            if path not in self._paths_before and _bytes_on_disk(path) >= _MIN_REPORTED_BYTES
        ]
        if not new:
            return ""
        more = f" and {len(new) - _MOST_LISTED_PATHS} more" if len(new) > _MOST_LISTED_PATHS else ""
        return (
            f"new in shared folders during this run: {', '.join(new[:_MOST_LISTED_PATHS])}{more}; if mutants "
            "made them, they are outside the limit on disk space, and later runs can find them"
        )

    def _list_paths(self) -> list[str]:
        paths = []
        for folder in self._folders:
            with suppress(OSError), os.scandir(folder) as entries:
                for entry in entries:
                    with suppress(OSError):
                        owner = entry.stat(follow_symlinks=False).st_uid
                        if owner == os.getuid() and not entry.name.startswith(_HARNESS_PREFIX):
                            paths.append(entry.path)
        return sorted(paths)


def _bytes_on_disk(path: str) -> int:
    with suppress(OSError):
        # a folder's own entry, in the unit of st_blocks, and its content
        return os.lstat(path).st_blocks * 512 + process_guard.disk_usage_bytes(path)
    return 0
