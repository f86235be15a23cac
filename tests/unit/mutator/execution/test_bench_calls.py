"""One call of a bench at a time, and none once it is closed."""

import threading
from pathlib import Path

import pytest

from mutator import MutatorError
from mutator.execution.bench_calls import BenchCalls


def test_closing_waits_for_a_call_and_refuses_the_next(tmp_path: Path) -> None:
    """The call that is running ends first; whoever calls afterwards is told that the bench is closed."""
    calls, has_begun, events = BenchCalls(tmp_path), threading.Event(), list[str]()
    may_end = threading.Event()

    def call() -> None:
        with calls.calling():
            has_begun.set()
            may_end.wait(60)
            events.append("call")

    thread = threading.Thread(target=call)
    thread.start()
    assert has_begun.wait(60)
    threading.Timer(0.1, may_end.set).start()
    with calls.closing():
        events.append("closed")
    thread.join()
    assert events == ["call", "closed"]
    with pytest.raises(MutatorError, match="this bench is closed"), calls.calling():
        pass


def test_a_failed_call_does_not_block_the_next(tmp_path: Path) -> None:
    """An error within a call ends it."""
    calls = BenchCalls(tmp_path)
    with pytest.raises(ZeroDivisionError), calls.calling():
        raise ZeroDivisionError
    with calls.calling(), pytest.raises(MutatorError, match="another call is running"), calls.calling():
        pass
