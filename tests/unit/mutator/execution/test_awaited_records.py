"""What a bench waits for."""

from mutator.execution.awaited_records import AwaitedRecords


def drained(awaited: AwaitedRecords) -> list[str]:
    return list(iter(awaited.next_arrived, None))


def test_a_record_is_given_as_often_as_it_was_requested() -> None:
    """At once if nothing runs for it, and otherwise when it arrives; not to whom did not ask."""
    awaited = AwaitedRecords()
    awaited.running |= {"a", "b", "unasked"}
    awaited.request(["a", "stored", "b"])
    awaited.request(["a"])
    assert drained(awaited) == ["stored"] and awaited.is_any_requested
    for name in ("b", "unasked", "a"):
        awaited.note_record(name)
    assert drained(awaited) == ["b", "a", "a"]
    assert not awaited.is_any_requested and not awaited.running


def test_what_finished_before_a_stop_is_still_given() -> None:
    """Nobody waits for the rest any longer."""
    awaited = AwaitedRecords()
    awaited.running |= {"a", "b"}
    awaited.request(["a", "b"])
    awaited.stop(lambda name: name == "b")
    assert drained(awaited) == ["b"]
    assert not awaited.is_any_requested and not awaited.running
