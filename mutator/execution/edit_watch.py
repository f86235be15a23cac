"""A thread that asks for edits all the time, and interrupts what the main thread does when there are some."""

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

_PAUSE_S = 0.25  # between two questions; edits count once there is none in such a pause


class EditWatch:
    """Calls `find_edits` until the end of its `with` block: it returns the files edited since the last call.

    All edits until a pause count as one: an editor writes a file in several steps, and `git checkout` many.
    """

    def __init__(self, find_edits: Callable[[], Sequence[Path]], pause_s: float = _PAUSE_S) -> None:
        self._find_edits, self._pause_s = find_edits, pause_s
        self._edited: dict[Path, None] = {}
        self._changed, self._is_interrupting = threading.Condition(), False
        self._failure: Exception | None = None
        self.has_interrupted = False  # since the last edits were handed over
        self._end = threading.Event()
        self._question_count = 0
        self._thread = threading.Thread(target=self._watch, name="edits", daemon=True)

    def __enter__(self) -> "EditWatch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def settle(self) -> bool:
        """Wait until what was edited before this call is known; return whether there are edits."""
        with self._changed:
            enough = self._question_count + 3  # one may be under way, and edits count after a pause
            self._wait_for(lambda: self._question_count >= enough)
            return bool(self._edited)

    def wait(self) -> tuple[Path, ...]:
        """Wait for edits; return the files."""
        with self._changed:
            self._is_interrupting = False  # also if the end of a block was interrupted
            self._wait_for(lambda: bool(self._edited))
            edited, self._edited, self.has_interrupted = tuple(self._edited), {}, False
            return edited

    @contextmanager
    def interrupting(self) -> Iterator[None]:
        """Interrupt the block, in the main thread, by SIGINT if there are edits: whatever can be interrupted
        by Ctrl-C can be interrupted so.
        """
        try:
            with self._changed:
                self._is_interrupting = True
                self._interrupt_if_edited()
            yield
        finally:
            with self._changed:
                self._is_interrupting = False

    def _interrupt_if_edited(self) -> None:
        if self._edited and self._is_interrupting and not self.has_interrupted:
            self.has_interrupted = True
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        self._changed.wait_for(lambda: self._failure or condition())
        if self._failure:
            raise self._failure

    def _watch(self) -> None:
        try:
            self._ask_until_end()
        except Exception as error:  # the main thread would wait for ever
            with self._changed:
                self._failure = error
                self._changed.notify_all()

    def _ask_until_end(self) -> None:
        pending: dict[Path, None] = {}
        while not self._end.wait(self._pause_s):
            new = self._find_edits()
            pending |= dict.fromkeys(new)
            with self._changed:
                self._question_count += 1
                if pending and not new:
                    self._edited, pending = self._edited | pending, {}
                    self._interrupt_if_edited()
                self._changed.notify_all()
