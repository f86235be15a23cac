"""The folder of one run, which the run can change in any way, and from which the harness reads.

A mutant can delete or rename its folders, lock them, or put links, pipes and other folders in their place.
In a sandbox, a process of the fork server, which runs on, could do so between the harness's look and its
reading. So both folders are held by descriptors from before the run, and everything is opened below these,
without following links. The plain files of the output are moved to a folder that no sandbox contains, before
anybody reads them by path. Thus an exchange cannot mislead the harness to other files, and every engine
reads the same of what a run left.

This does not protect a file's content: without a sandbox, every process of the user can write to it.
"""

import errno
import os
import stat
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from mutator._common.confined_files import move_plain_files, open_folder, read_below
from mutator._common.files import remove_anything_at
from mutator.engines.process_endings import parse_run_report, read_log_tail
from mutator.errors import UnsafePath

PLAIN_OUTPUT_FOLDER = "output"  # the name of the folder with the output's plain files
_OUT_FOLDER, _LOG_FILE, _REPORT_FILE, _INACTIVE_MARKER = "out", "log", "report.json", "inactive"


_CHILD_ACTIVATIONS_FILE = "child_activations"  # what forked children of the target append
_DISTURBANCE_ERRNOS = (errno.ENOENT, errno.EEXIST, errno.ENOTDIR, errno.EISDIR, errno.ELOOP, errno.ENOTEMPTY)
_LOCKED_ERRNOS = (errno.EACCES, errno.EPERM)


def can_be_disturbance(err: OSError) -> bool:
    """Return whether an error can result from what a run did to the folders of this or another run."""
    return err.errno in (*_DISTURBANCE_ERRNOS, *_LOCKED_ERRNOS)


def ensure_work_folder(work_folder: Path) -> None:
    """Make the folder of all runs again if a run has deleted it, or put something else in its place."""
    try:
        if stat.S_ISDIR(os.lstat(work_folder).st_mode):
            return
        work_folder.unlink()
    except FileNotFoundError:
        pass
    work_folder.mkdir(parents=True, exist_ok=True)


class JobFolder:
    """The new folder `path`, open until the end of a `with` block. OSError if it cannot be made."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.output_folder = path / _OUT_FOLDER
        self.child_activations_path = path / _CHILD_ACTIVATIONS_FILE
        self._open_handles = ExitStack()

    def __enter__(self) -> "JobFolder":
        self.path.mkdir(stat.S_IRWXU, parents=True, exist_ok=True)
        with ExitStack() as opened:
            self._folder_handle = opened.enter_context(open_folder(self.path))
            os.mkdir(_OUT_FOLDER, stat.S_IRWXU, dir_fd=self._folder_handle)
            self._output_handle = opened.enter_context(open_folder(_OUT_FOLDER, self._folder_handle))
            self._open_handles = opened.pop_all()
        self._path_by_handle = Path(f"/proc/self/fd/{self._folder_handle}")
        return self

    def __exit__(self, *error: object) -> None:
        self._open_handles.close()

    def was_moved(self) -> bool:
        """Return whether the folder or that of the output is no longer in its place."""
        places = ((self.path, self._folder_handle), (self.output_folder, self._output_handle))
        return not all(_is_path_of_handle(path, handle) for path, handle in places)

    def unlock(self) -> None:
        """Make the folder readable again, which a run can lock."""
        os.fchmod(self._folder_handle, 0o700)

    def move_plain_output(self, destination: Path) -> Path:
        """Move the plain files of the output to the new folder `destination`; return it."""
        remove_anything_at(destination)
        destination.mkdir(parents=True)
        with open_folder(destination) as target:
            move_plain_files(self._output_handle, target)
        return destination


class ReportingJobFolder(JobFolder):
    """The folder of a run that leaves its report and log there."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.log_path, self.report_path = path / _LOG_FILE, path / _REPORT_FILE
        self.inactive_marker = path / _INACTIVE_MARKER  # the first activation deletes it

    def __enter__(self) -> "ReportingJobFolder":
        super().__enter__()
        os.close(os.open(_INACTIVE_MARKER, os.O_CREAT | os.O_EXCL, 0o644, dir_fd=self._folder_handle))
        return self

    def read_report(self, **extra_fields: type) -> dict[str, Any] | None:
        """Return the child's report; None if it is missing, incomplete or invalid (`parse_run_report`)."""
        try:
            return parse_run_report(read_below(self._path_by_handle, _REPORT_FILE), **extra_fields)
        except (OSError, UnsafePath, ValueError):
            return None

    def log_tail(self) -> str:
        return read_log_tail(self._path_by_handle, _LOG_FILE)

    def was_fault_active(self) -> bool:
        try:
            os.stat(_INACTIVE_MARKER, dir_fd=self._folder_handle, follow_symlinks=False)
        except OSError:
            return True
        return False


def _is_path_of_handle(path: Path, handle: int) -> bool:
    try:
        return os.path.samestat(os.lstat(path), os.fstat(handle))
    except OSError:
        return False
