"""Locks that let only one command at a time use a run folder. They use `flock`, so the kernel releases them
when the process ends.
"""

import fcntl
import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mutator._common.confined_files import open_descriptor_below, read_below, unlink_below
from mutator._common.files import raising_disk_full
from mutator.errors import MutatorError, UnsafePath

OWNER_LOCK_FILE = "owner.lock"  # locked by the owner; its content, a process id, only serves the error
WORKERS_FOLDER = "workers"  # a locked file for each living worker, named after its process id
_WORKER_PATIENCE_S = 15.0  # workers of a dead command exit well within this time


@contextmanager
def lock_run_folder(run: Path, patience_s: float = _WORKER_PATIENCE_S) -> Iterator[None]:
    """Lock the existing folder `run`; MutatorError while another command or its workers use it."""
    with raising_disk_full(run):
        fd = _open_lock_file(run, OWNER_LOCK_FILE, os.O_CREAT)
    try:
        if not _try_lock(fd):
            raise MutatorError(
                f"in use by process {os.read(fd, 32).decode(errors='replace').strip() or '(unknown)'}",
                where=run,
                expected="one command at a time in a run folder",
                remedy="wait until that process ends, or use another folder",
            )
        with raising_disk_full(run):
            os.ftruncate(fd, 0)
            os.write(fd, f"{os.getpid()}\n".encode())
        if living := wait_for_workers(run, patience_s):
            raise MutatorError(
                f"workers of an earlier run are still running (process id: {', '.join(map(str, living))})",
                where=run,
                expected="no workers in this folder",
                remedy="wait for them or end them, then run the same command again",
            )
        try:
            yield
        finally:
            living_worker_pids(run)
            with suppress(OSError):  # some workers are still ending, or there were none
                (run / WORKERS_FOLDER).rmdir()  # never follows a link
    finally:
        os.close(fd)


def is_owner_alive(run: Path) -> bool:
    """Whether a process of this machine holds the lock of `run`. Asking never gets in a command's way, as
    trying to lock would.
    """
    try:
        pid = int(read_below(run, OWNER_LOCK_FILE))
        descriptors = list(Path(f"/proc/{pid}/fd").iterdir())
    except PermissionError:  # a process of another user
        return True
    except (OSError, ValueError, MutatorError):
        return False
    lock = str(run.resolve() / OWNER_LOCK_FILE)
    return any(_link_target(descriptor) == lock for descriptor in descriptors)


def _link_target(path: Path) -> str:
    try:
        return str(path.readlink())
    except OSError:  # closed meanwhile
        return ""


@contextmanager
def locking_folder(folder: Path) -> Iterator[None]:
    """Wait for an exclusive lock on an existing folder. Nothing is written."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def open_worker_lock(run: Path) -> int:
    """Register this process as a worker in `run` until the returned descriptor is closed."""
    with raising_disk_full(run):
        (run / WORKERS_FOLDER).mkdir(exist_ok=True)
        fd = _open_lock_file(run, f"{WORKERS_FOLDER}/{os.getpid()}", os.O_CREAT)
    fcntl.flock(fd, fcntl.LOCK_EX)
    return fd


def living_worker_pids(run: Path) -> list[int]:
    """Return the process ids of the workers in `run`, and remove the entries of dead workers."""
    living = []
    names = (path.name for path in (run / WORKERS_FOLDER).glob("[0-9]*"))
    for name in sorted(filter(str.isdecimal, names)):
        try:
            fd = _open_lock_file(run, f"{WORKERS_FOLDER}/{name}")
        except FileNotFoundError:  # another process removed it
            continue
        try:
            if _try_lock(fd):
                unlink_below(run, f"{WORKERS_FOLDER}/{name}")
            else:
                living.append(int(name))
        finally:
            os.close(fd)
    return living


def wait_for_workers(run: Path, patience_s: float = _WORKER_PATIENCE_S) -> list[int]:
    """Wait until no worker is left in `run`; return the process ids of workers that outlive `patience_s`."""
    deadline = time.monotonic() + patience_s
    while (living := living_worker_pids(run)) and time.monotonic() <= deadline:
        time.sleep(0.1)  # usually they end within a few of these
    return living


def _open_lock_file(run: Path, name: str, more_flags: int = 0) -> int:
    """Open a lock; MutatorError unless it is a file with no other name, because it is written in place."""
    try:
        fd = open_descriptor_below(run, name, os.O_RDWR | more_flags)
    except (UnsafePath, IsADirectoryError):
        raise _bad_lock_file_error(run / name) from None
    state = os.fstat(fd)
    if not stat.S_ISREG(state.st_mode) or state.st_nlink > 1:
        os.close(fd)
        raise _bad_lock_file_error(run / name)
    return fd


def _bad_lock_file_error(path: Path) -> MutatorError:
    return MutatorError(
        "not a regular file with a single name",
        where=path,
        expected="a file of the run folder",
        remedy="delete it: it holds no results",
    )


def _try_lock(fd: int) -> bool:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
