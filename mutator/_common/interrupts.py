"""Ctrl-C and SIGTERM: both end the work in order, but never in the middle of a parse."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True)
class _State:
    held: int = 0  # depth
    asked: bool = False  # for an interruption, while held


_state = _State()


@contextmanager
def terminable() -> Iterator[None]:
    """Within it, SIGINT and SIGTERM raise KeyboardInterrupt: stop in order, keep what finished.

    A process that ignores SIGINT goes on ignoring it.
    """

    def interrupt(number: int, frame: object) -> None:
        if _state.held:
            _state.asked = True
        else:
            raise KeyboardInterrupt

    before = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, interrupt)
    except ValueError:  # not the main thread: signals are another's business
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def held() -> Iterator[None]:
    """Within it, an interruption waits until the end.

    Native code that calls Python turns an exception raised there into one of its own.
    """
    _state.held += 1
    try:
        yield
    finally:
        _state.held -= 1
        if _state.asked and not _state.held:
            _state.asked = False
            raise KeyboardInterrupt
