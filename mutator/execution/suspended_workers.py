"""Continue workers that were stopped. A mutant can stop its worker, and the command would wait for ever."""

import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from mutator.engines.in_target import process_guard

_CHECK_INTERVAL_S = 1.0  # what a stopped worker loses at most
_SUSPENDED_STATE = "T"  # in /proc/PID/stat


def _own_children() -> list[int]:
    return process_guard.child_pids(os.getpid())


class WorkerContinuer:
    """A thread that tells stopped workers that they were stopped, and continues them. `find_workers` returns
    their process ids; default: all child processes of this process.

    Stopping all processes of a terminal (Ctrl-Z) also stops this thread, so `fg` tells nobody.
    """

    def __init__(self, find_workers: Callable[[], Iterable[int]] = _own_children) -> None:
        self._find_workers = find_workers
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._continue_suspended_workers, daemon=True)
        self._thread.start()

    def end(self) -> None:
        self._ended.set()
        self._thread.join()

    def _continue_suspended_workers(self) -> None:
        while not self._ended.wait(_CHECK_INTERVAL_S):
            for pid in _suspended(self._find_workers()):
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGUSR1)  # waits until the process continues
                    os.kill(pid, signal.SIGCONT)


def on_resume(callback: Callable[[], None]) -> None:
    """Call `callback` when this process was stopped and another one's `WorkerContinuer` has continued it."""
    signal.signal(signal.SIGUSR1, lambda number, frame: callback())


def _suspended(pids: Iterable[int]) -> Iterator[int]:
    for pid in pids:
        with suppress(OSError):
            # after the name in parentheses, which can hold both spaces and parentheses
            state = Path(f"/proc/{pid}/stat").read_text(errors="replace").rpartition(")")[2].split()[0]
            if state == _SUSPENDED_STATE:
                yield pid
