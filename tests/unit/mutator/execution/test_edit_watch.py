"""Edits interrupt the main thread, and count once there are no more for a while."""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from mutator.execution.edit_watch import EditWatch

A, B = Path("a"), Path("b")


def answers(*values: Sequence[Path]) -> Callable[[], Sequence[Path]]:
    remaining = list(values)
    return lambda: remaining.pop(0) if remaining else ()


def test_edits_in_a_row_are_handed_over_together() -> None:
    """An editor that writes twice starts one pass."""
    with EditWatch(answers([A], [B], [A]), 0.01) as edits:
        assert edits.wait() == (A, B)


def test_an_edit_interrupts_a_block_but_nothing_after_it() -> None:
    """A pass is interrupted; what follows it is not."""
    begun = threading.Event()

    def find() -> Sequence[Path]:
        return [A] if begun.is_set() and not begun.clear() else ()

    with EditWatch(find, 0.01) as edits:
        with pytest.raises(KeyboardInterrupt), edits.interrupting():
            begun.set()
            time.sleep(10)
        assert edits.has_interrupted
        assert edits.wait() == (A,)
        assert not edits.has_interrupted
        begun.set()
        time.sleep(0.1)
        assert edits.wait() == (A,)


def test_an_edit_before_a_block_interrupts_it() -> None:
    """What was edited between planning and running is not run."""
    with EditWatch(answers([A]), 0.01) as edits:
        assert edits.settle()
        with pytest.raises(KeyboardInterrupt), edits.interrupting():
            time.sleep(10)


def test_an_edit_before_a_block_interrupts_nothing_after_it() -> None:
    """The next edit waits to be asked for, too."""
    begun = threading.Event()

    def find() -> Sequence[Path]:
        return [A] if begun.is_set() and not begun.clear() else ()

    with EditWatch(find, 0.01) as edits:
        begun.set()
        assert edits.settle()
        with pytest.raises(KeyboardInterrupt), edits.interrupting():
            time.sleep(10)
        assert edits.wait() == (A,)
        begun.set()
        time.sleep(0.1)
        assert edits.wait() == (A,)


def test_without_edits_settling_says_so() -> None:
    """After a failure of a pass, it is known whether an edit was its reason."""
    with EditWatch(answers(), 0.01) as edits:
        assert not edits.settle()


def test_a_failure_of_the_thread_reaches_who_waits() -> None:
    """Nobody waits for a thread that has died."""

    def fail() -> Sequence[Path]:
        raise OSError("gone")

    with EditWatch(fail, 0.01) as edits, pytest.raises(OSError, match="gone"):
        edits.wait()
