"""Handle Ctrl-C and SIGTERM: both stop the work in an orderly way, but never during a parse."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True)
class _State:
    held: int = 0  # nesting depth of `held` blocks
    asked: bool = False  # an interruption arrived in a `held` block


_state = _State()


@contextmanager
def terminable() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGINT and SIGTERM within the block, so that finished work is kept.

    A process that ignores SIGINT keeps ignoring it.
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
    except ValueError:  # not the main thread, which cannot set handlers
        yield
        return
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def held() -> Iterator[None]:
    """Delay an interruption until the end of the block.

    Native code that calls Python, such as a parser, would replace KeyboardInterrupt with another exception.
    """
    _state.held += 1
    try:
        yield
    finally:
        _state.held -= 1
        if _state.asked and not _state.held:
            _state.asked = False
            raise KeyboardInterrupt
