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
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any

WALL, DISK, ABANDONED = "wall", "disk", "abandoned"  # reasons for stopping a process
HARD_CPU_EXTRA_S = 2  # delay until a process that ignores SIGXCPU is killed
# from linux/prctl.h, because Python has no names for them
_PR_SET_PDEATHSIG = 1
_PR_SET_CHILD_SUBREAPER = 36
# without those that nobody can handle, and those that Python itself ignores in every process
_SIGNALS_TO_RESTORE = signal.valid_signals() - {
    signal.SIGKILL,
    signal.SIGSTOP,
    signal.SIGPIPE,
    signal.SIGXFSZ,
}
_SPACE_CHECK_INTERVAL_S = 0.2  # interval between two checks of the space used
_SPACE_CHECK_TIME_DIVISOR = 20  # the checks take at most 1/_SPACE_CHECK_TIME_DIVISOR of the time
_BLOCK_BYTES = 512  # bytes; the unit of st_blocks
_libc = ctypes.CDLL(None)


class DiskGrowthLimit:
    """A limit on how much the folder `home` can grow: `disk_mb` MiB.

    The folder is held open, because a run can rename it and put a link to a large one in its place. What the
    `open_files` outside of it take counts, too.
    """

    def __init__(self, home: str, disk_mb: int, open_files: Sequence[int] = ()) -> None:
        self._handle = os.open(home, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
        self._home = f"/proc/self/fd/{self._handle}"
        self._open_files = open_files
        self._most_bytes = self._used_bytes() + (disk_mb << 20)

    def is_used_up(self) -> bool:
        return self._used_bytes() >= self._most_bytes

    def _used_bytes(self) -> int:
        files = sum(os.fstat(file).st_blocks * _BLOCK_BYTES for file in self._open_files)
        return disk_usage_bytes(self._home) + files

    def close(self) -> None:
        os.close(self._handle)


def fork_guarded(
    caller_fd: int,
    *,
    wall_s: float = math.inf,
    space_limit: DiskGrowthLimit | None = None,
    patience_s: float = 0.0,
) -> dict[str, Any] | None:
    """Fork. Return None in the child, which leads its own session and dies with its parent.

    The parent waits until the child ends, a limit stops it, or the other end of `caller_fd` (a pipe or
    socket) is closed. The parent then kills everything that the child left running. If the caller closes its
    end, the child has `patience_s` to end by itself. The parent returns `code` (negative for a signal),
    `cpu_s`, `wall_s`, and `stopped`: WALL, DISK, ABANDONED or "".
    """
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    began, parent, pid = time.monotonic(), os.getpid(), os.fork()
    if not pid:
        if space_limit is not None:
            space_limit.close()
        os.setsid()
        die_with_parent(parent)
        return None
    try:
        stopped = _wait_for_child(pid, caller_fd, began + wall_s, space_limit)
        if stopped == ABANDONED and patience_s:
            _terminate_child(pid, patience_s)
    finally:
        os.kill(pid, signal.SIGKILL)  # also after its end: its pid is taken until `wait4` reaps it
        _, code, usage = os.wait4(pid, 0)
        _kill_leftover_processes()
    if not stopped and space_limit is not None and space_limit.is_used_up():
        stopped = DISK
    if space_limit is not None:
        space_limit.close()
    return {
        "code": os.waitstatus_to_exitcode(code),
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "wall_s": time.monotonic() - began,
        "stopped": stopped,
    }


def restore_default_signals() -> None:
    """Restore the default signal handling, which shells change for background processes.

    Only before the target's code runs: what a golden run sets holds in its forks, too.
    """
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    for number in _SIGNALS_TO_RESTORE:
        if signal.getsignal(number) is signal.SIG_IGN:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)


def die_with_parent(parent_pid: int) -> None:
    """Make the kernel kill this process when its parent dies. Exit now if `parent_pid` is no longer that."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:
        os._exit(1)


def disk_usage_bytes(folder: str) -> int:
    """Return the bytes that a folder's readable content takes on the disk."""
    total, folders = 0, [folder]
    while folders:
        with suppress(OSError), os.scandir(folders.pop()) as entries:
            for entry in entries:
                with suppress(OSError):
                    total += entry.stat(follow_symlinks=False).st_blocks * _BLOCK_BYTES
                    if entry.is_dir(follow_symlinks=False):
                        folders.append(entry.path)
    return total


def _prctl(option: int, value: int) -> None:
    _libc.prctl(option, value, 0, 0, 0)


def _wait_for_child(pid: int, caller_fd: int, deadline: float, space_limit: DiskGrowthLimit | None) -> str:
    """Wait until the child ends, without reaping it, or must be stopped; return the reason to stop it."""
    handle, pause = os.pidfd_open(pid), _SPACE_CHECK_INTERVAL_S
    poll = select.poll()
    poll.register(handle, select.POLLIN)
    poll.register(caller_fd, 0)  # 0: report only that the other end is closed
    try:
        while True:
            remaining_s = deadline - time.monotonic()
            ready = {fd for fd, _ in poll.poll(max(0.0, min(remaining_s, pause)) * 1000)}
            if ready:
                return ABANDONED if caller_fd in ready else ""
            if remaining_s <= 0:
                return WALL
            began = time.monotonic()
            if space_limit is not None and space_limit.is_used_up():
                return DISK
            pause = max(_SPACE_CHECK_INTERVAL_S, (time.monotonic() - began) * _SPACE_CHECK_TIME_DIVISOR)
    finally:
        os.close(handle)


def _terminate_child(pid: int, patience_s: float) -> None:
    os.kill(pid, signal.SIGTERM)
    handle = os.pidfd_open(pid)
    try:
        select.select([handle], [], [], patience_s)
    finally:
        os.close(handle)


def _kill_leftover_processes() -> None:
    """Kill and reap children in other sessions, with all their descendants."""
    session, spared = os.getsid(0), set[int]()  # spared: processes of root, which cannot be killed
    while leftover_pids := [
        pid for pid in child_pids(os.getpid()) if os.getsid(pid) != session and pid not in spared
    ]:
        for pid in _pids_with_descendants(leftover_pids):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
            except PermissionError:
                spared.add(pid)
        for pid in set(leftover_pids) - spared:
            os.waitpid(pid, 0)


def _pids_with_descendants(pids: Iterable[int]) -> list[int]:
    all_pids = list(pids)
    for pid in all_pids:
        all_pids += child_pids(pid)
    return all_pids


def child_pids(pid: int) -> list[int]:
    """Return the children of `pid`, including dead ones that are not reaped."""
    pids: list[int] = []
    with suppress(OSError), os.scandir(f"/proc/{pid}/task") as threads:  # the process can end meanwhile
        for thread in threads:
            with io.FileIO(f"{thread.path}/children") as file:
                pids += map(int, file.read().split())
    return pids


if __name__ == "__main__":
    die_with_parent(int(sys.argv[1]))
    os.execv(sys.argv[2], sys.argv[2:])
