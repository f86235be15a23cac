"""The calls of an open bench: one at a time, and none once it is closed."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from mutator._common.interrupts import raising_keyboard_interrupts
from mutator.errors import MutatorError


class BenchCalls:
    """Lets one call at a time use the bench in the folder `path`."""

    def __init__(self, path: Path) -> None:
        self._path, self._lock, self._is_refusing = path, threading.Lock(), False

    @contextmanager
    def calling(self) -> Iterator[None]:
        """Make a call; MutatorError during a call of another thread, and once the bench is closed."""
        if not self._lock.acquire(blocking=False):
            raise MutatorError(
                "another call is running",
                where=self._path,
                expected="one caller of a bench at a time",
                remedy="wait for it, or open another bench in another folder",
            )
        try:
            if self._is_refusing:
                raise MutatorError(
                    "this bench is closed",
                    where=self._path,
                    expected="calls inside of its `with` block",
                    remedy="open it again: what has finished is not repeated",
                )
            with raising_keyboard_interrupts():
                yield
        finally:
            self._lock.release()

    def refuse(self) -> None:
        """Refuse further calls."""
        self._is_refusing = True

    @contextmanager
    def closing(self) -> Iterator[None]:
        """Refuse further calls, and wait for the end of a call of another thread."""
        self.refuse()
        with raising_keyboard_interrupts(), self._lock:
            yield
