"""Handle Ctrl-C and SIGTERM: both stop the work in an orderly way, but never during a parse."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(slots=True)
class _InterruptState:
    delay_depth: int = 0  # nesting depth of `delaying_interrupts` blocks
    is_pending: bool = False  # an interruption arrived in such a block


_interrupt_state = _InterruptState()


@contextmanager
def raising_keyboard_interrupts() -> Iterator[None]:
    """Raise KeyboardInterrupt on SIGINT and SIGTERM within the block, so that finished work is kept.

    A process that ignores SIGINT keeps ignoring it.
    """

    def interrupt(number: int, frame: object) -> None:
        if _interrupt_state.delay_depth:
            _interrupt_state.is_pending = True
        else:
            raise KeyboardInterrupt

    previous_handlers = {}
    try:
        for number in (signal.SIGINT, signal.SIGTERM):
            if signal.getsignal(number) is not signal.SIG_IGN:
                previous_handlers[number] = signal.signal(number, interrupt)
    except ValueError:  # not the main thread, which cannot set handlers
        yield
        return
    try:
        yield
    finally:
        for number, handler in previous_handlers.items():
            signal.signal(number, handler)


@contextmanager
def delaying_interrupts() -> Iterator[None]:
    """Delay an interruption until the end of the block.

    Native code that calls Python, such as a parser, would replace KeyboardInterrupt with another exception.
    """
    _interrupt_state.delay_depth += 1
    try:
        yield
    finally:
        _interrupt_state.delay_depth -= 1
        if _interrupt_state.is_pending and not _interrupt_state.delay_depth:
            _interrupt_state.is_pending = False
            raise KeyboardInterrupt
