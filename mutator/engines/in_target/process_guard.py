"""Run code in a separate process within limits, and end everything it started. Standard library only.

The waiting process is a subreaper: it adopts and kills the processes that its descendants leave behind, in
any session. As a script, `process_guard.py PARENT PROGRAM WORDS...` becomes that program, but dies with its
parent.
"""

import ctypes
import io
import math
import os
import select
import signal
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from typing import Any

WALL, DISK, ABANDONED = "wall", "disk", "abandoned"  # reasons for stopping a process
HARD_CPU_EXTRA_S = 2  # delay until a process that ignores SIGXCPU is killed
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
_MINDED = signal.valid_signals() - {signal.SIGKILL, signal.SIGSTOP, signal.SIGPIPE, signal.SIGXFSZ}
_LOOK_S = 0.2  # interval between two checks of the space used
_LOOK_SHARE = 20  # the checks take at most 1/_LOOK_SHARE of the time
_BLOCK = 512  # bytes; the unit of st_blocks
_libc = ctypes.CDLL(None)


class Space:
    """A limit on how much the folder `home` can grow: `disk_mb` MiB.

    The folder is held open, because a run can rename it and put a link to a large one in its place.
    """

    def __init__(self, home: str, disk_mb: int) -> None:
        self._handle = os.open(home, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        self._home = f"/proc/self/fd/{self._handle}"
        self._most = used(self._home) + (disk_mb << 20)

    def is_used_up(self) -> bool:
        return used(self._home) >= self._most

    def close(self) -> None:
        os.close(self._handle)


def fork(
    caller: int, *, wall_s: float = math.inf, space: Space | None = None, patience_s: float = 0.0
) -> dict[str, Any] | None:
    """Fork. Return None in the child, which leads its own session and dies with its parent.

    The parent waits until the child ends, a limit stops it, or the other end of `caller` (a pipe or socket)
    is closed. The parent then kills everything that the child left running. If the caller closes its end, the
    child has `patience_s` to end by itself. The parent returns `code` (negative for a signal), `cpu_s`,
    `wall_s`, and `stopped`: WALL, DISK, ABANDONED or "".
    """
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    began, parent, pid = time.monotonic(), os.getpid(), os.fork()
    if not pid:
        if space is not None:
            space.close()
        os.setsid()
        _mind_signals()
        die_with_parent(parent)
        return None
    try:
        stopped = _wait(pid, caller, began + wall_s, space)
        if stopped == ABANDONED and patience_s:
            _ask_to_end(pid, patience_s)
    finally:
        os.kill(pid, signal.SIGKILL)
        _, code, usage = os.wait4(pid, 0)
        _end_what_is_left()
    if not stopped and space is not None and space.is_used_up():
        stopped = DISK
    if space is not None:
        space.close()
    return {
        "code": os.waitstatus_to_exitcode(code),
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "wall_s": time.monotonic() - began,
        "stopped": stopped,
    }


def _mind_signals() -> None:
    """Restore the default signal handling, which shells change for background processes."""
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    for number in _MINDED:
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


def die_with_parent(parent: int) -> None:
    """Make the kernel kill this process when `parent` dies. Exit now if `parent` is no longer the parent."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def used(folder: str) -> int:
    """Return the bytes that a folder's readable content takes on the disk."""
    total, folders = 0, [folder]
    while folders:
        with suppress(OSError), os.scandir(folders.pop()) as entries:
            for entry in entries:
                with suppress(OSError):
                    total += entry.stat(follow_symlinks=False).st_blocks * _BLOCK
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
    return total


def _prctl(option: int, value: int) -> None:
    _libc.prctl(option, value, 0, 0, 0)


def _wait(pid: int, caller: int, deadline: float, space: Space | None) -> str:
    """Wait until the child ends, without reaping it, or must be stopped; return the reason to stop it."""
    handle, pause = os.pidfd_open(pid), _LOOK_S
    poll = select.poll()
    poll.register(handle, select.POLLIN)
    poll.register(caller, 0)
    try:
        while True:
            left = deadline - time.monotonic()
            ready = {fd for fd, _ in poll.poll(max(0.0, min(left, pause)) * 1000)}
            if ready:
                return ABANDONED if caller in ready else ""
            if left <= 0:
                return WALL
            began = time.monotonic()
            if space is not None and space.is_used_up():
                return DISK
            pause = max(_LOOK_S, (time.monotonic() - began) * _LOOK_SHARE)
    finally:
        os.close(handle)


def _ask_to_end(pid: int, patience_s: float) -> None:
    os.kill(pid, signal.SIGTERM)
    handle = os.pidfd_open(pid)
    try:
        select.select([handle], [], [], patience_s)
    finally:
        os.close(handle)


def _end_what_is_left() -> None:
    """Kill and reap children in other sessions, with all their descendants."""
    session, spared = os.getsid(0), set[int]()  # spared: processes of root, which cannot be killed
    while left := [pid for pid in children(os.getpid()) if os.getsid(pid) != session and pid not in spared]:
        for pid in _with_descendants(left):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            except PermissionError:
                spared.add(pid)
        for pid in set(left) - spared:
            os.waitpid(pid, 0)


def _with_descendants(pids: Iterable[int]) -> list[int]:
    found = list(pids)
    for pid in found:
        found += children(pid)
    return found


def children(pid: int) -> list[int]:
    """Return the children of `pid`, including dead ones that are not reaped."""
    found: list[int] = []
    with suppress(OSError), os.scandir(f"/proc/{pid}/task") as threads:  # the process can end meanwhile
        for thread in threads:
            with io.FileIO(f"{thread.path}/children") as file:
                found += map(int, file.read().split())
    return found


if __name__ == "__main__":
    die_with_parent(int(sys.argv[1]))
    os.execv(sys.argv[2], sys.argv[2:])
