"""Locks that let only one command at a time use a run folder. They use `flock`, so the kernel releases them
when the process ends."""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from mutator._common.files import is_no_file, no_pipe, raising_disk_full
from mutator.errors import MutatorError

OWNER = "owner.lock"
WORKERS = "workers"
_PATIENCE_S = 15.0  # workers of a dead command exit well within this time


@contextmanager
def owned(run: Path, patience_s: float = _PATIENCE_S) -> Iterator[None]:
    """Lock the existing folder `run`; MutatorError while another command or its workers use it."""
    with raising_disk_full(run):
        fd = _opened(run / OWNER, os.O_CREAT)
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
            living_workers(run)
            with suppress(OSError):  # some workers are still ending, or there were none
                (run / WORKERS).rmdir()
    finally:
        os.close(fd)


@contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Wait for an exclusive lock on an existing folder. Nothing is written."""
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX)
        yield
    finally:
        os.close(fd)


def register_worker(run: Path) -> int:
    """Register this process as a worker in `run` until the returned descriptor is closed."""
    with raising_disk_full(run):
        folder = run / WORKERS
        folder.mkdir(exist_ok=True)
        fd = _opened(folder / str(os.getpid()), os.O_CREAT)
    fcntl.flock(fd, fcntl.LOCK_EX)
    return fd


def living_workers(run: Path) -> list[int]:
    """Return the process ids of the workers in `run`, and remove the entries of dead workers."""
    living = []
    for path in sorted((run / WORKERS).glob("[0-9]*")):
        try:
            fd = _opened(path)
        except FileNotFoundError:  # another process removed it
            continue
        try:
            if _try_lock(fd):
                path.unlink(missing_ok=True)
            else:
                living.append(int(path.name))
        finally:
            os.close(fd)
    return living


def wait_for_workers(run: Path, patience_s: float = _PATIENCE_S) -> list[int]:
    """Wait until no worker is left in `run`; return the process ids of workers that outlive `patience_s`."""
    deadline = time.monotonic() + patience_s
    while (living := living_workers(run)) and time.monotonic() <= deadline:
        time.sleep(0.1)
    return living


def _opened(path: Path, more: int = 0) -> int:
    """Open a file; MutatorError for a folder, a pipe or a link."""
    try:
        return os.open(no_pipe(path), os.O_RDWR | os.O_NOFOLLOW | more, 0o644)
    except OSError as err:
        if isinstance(err, FileNotFoundError) or not is_no_file(err):
            raise
        raise MutatorError(
            f"not a regular file ({err.strerror})",
            where=path,
            expected="a file of the run folder",
            remedy="delete it: it holds no results",
        ) from None


def _try_lock(fd: int) -> bool:
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True
