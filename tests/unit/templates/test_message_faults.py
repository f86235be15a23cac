"""The effects of fault models on messages that a function reads or gets, step by step."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.model import Anchor, AnchorKind, FaultLocation, Injection, Value
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, unsplice
from mutator.workspace import Workspace
from tests.unit.templates.function_with_fault import FaultyFunction, WithFault, counting

READ = "def f(queue):\n    return [content for name, content in queue]\n"
CALLBACK = "def f(scan):\n    return scan\n"
SPEED = {"topic": "message[0]", "name": "speed"}


def numbered(topic: str, counts: list[int]) -> Callable[[], list[tuple[str, int]]]:
    """Return a reader's queues: in each step so many messages of the topic, numbered, and one of another."""
    number, steps = counting(), iter(counts)
    return lambda: [*((topic, number()) for _ in range(next(steps))), ("gear", 0)]


@pytest.mark.parametrize(
    ("model", "more", "expected"),
    [
        ("message_loss", {}, [[1, 0], [0], [0], [0], [5, 0]]),
        ("message_freeze", {}, [[1, 0], [2, 0], [2, 0], [2, 0], [5, 0]]),
        ("message_delay", {"delay": 0.1}, [[1, 0], [0], [0, 2], [0, 3], [5, 0]]),
        ("message_delay", {"delay": 0.0}, [[1, 0], [0, 2], [0, 3], [0, 4], [5, 0]]),
        ("message_repetition", {}, [[1, 0], [2, 2, 0], [3, 3, 0], [4, 4, 0], [5, 0]]),
        ("message_reordering", {}, [[1, 0], [0], [3, 2, 0], [0], [5, 0]]),
    ],
)
def test_messages_of_one_topic_are_changed_on_their_way(
    with_fault: WithFault, model: str, more: dict[str, Value], expected: list[list[int]]
) -> None:
    """Only messages of the topic are changed, only while the fault is active."""
    faulty = with_fault(READ, AnchorKind.ENTRY, "", model, queue="queue", **SPEED, **more)
    assert faulty.run(".xxx.", numbered("speed", [1] * 5)) == expected


def test_messages_overtake_each_other_within_one_reading(with_fault: WithFault) -> None:
    faulty = with_fault(READ, AnchorKind.ENTRY, "", "message_reordering", queue="queue", **SPEED)
    assert faulty.run("xx", numbered("speed", [3, 1])) == [[2, 1, 0], [4, 3, 0]]


def test_an_empty_place_in_a_queue_is_no_message(with_fault: WithFault) -> None:
    """openpilot's readers put None into the list for a topic without a new message."""
    source = "def f(queue):\n    return queue\n"
    for model in ("message_loss", "message_freeze", "message_repetition", "message_reordering"):
        faulty = with_fault(
            source, AnchorKind.ENTRY, "", model, queue="queue", topic="message.which()", name="speed"
        )
        assert faulty.run("x", lambda: [None]) == [[None]]


@pytest.mark.parametrize(
    ("model", "more", "expected"),
    [
        ("message_loss", {}, [1, None, None, None, 5]),
        ("message_freeze", {}, [1, 2, 2, 2, 5]),
        ("message_delay", {"delay": 0.1}, [1, None, 2, 3, 5]),
    ],
)
def test_a_callback_gets_no_message_or_another(
    with_fault: WithFault, model: str, more: dict[str, Value], expected: list[int | None]
) -> None:
    faulty = with_fault(CALLBACK, AnchorKind.ENTRY, "", model, message="scan", **more)
    assert faulty.run(".xxx.", counting()) == expected


LATE = {"delay": 0.2}


def run_callback(faulty: FaultyFunction, calls: list[tuple[float, Any]]) -> list[Any]:
    """Return what a callback gets in each call, at these times in s; None for a call that ends at once."""
    results, now = [], -1.0
    for time, message in calls:
        if time > now:
            faulty.probe.observe(t=time, d_rel=40.0, v_ego=20.0, v_lead=15.0)
            now = time
        results.append(faulty.names["f"](message))
    return results


@pytest.mark.parametrize(
    ("times", "expected"),
    [
        # two calls in each step: both messages come 0.2 s later, one in each call
        ([0.0, 0.0, 0.1, 0.1, 0.2, 0.2, 0.3, 0.3], [None, None, None, None, 0, 1, 2, 3]),
        # at 0.5 s, those of 0.1 and 0.2 s are due; the second comes at 0.6 s
        ([0.0, 0.1, 0.2, 0.5, 0.6, 0.7], [None, None, 0, 1, 2, 3]),
        ([0.0, 0.5, 0.6, 0.7, 0.8], [None, 0, None, 1, 2]),
    ],
)
def test_a_late_message_of_a_callback_waits_for_a_call_of_its_own(
    with_fault: WithFault, times: list[float], expected: list[int | None]
) -> None:
    """Messages that are due together come one by one, in order; none vanishes."""
    faulty = with_fault(CALLBACK, AnchorKind.ENTRY, "", "message_delay", message="scan", **LATE)
    assert run_callback(faulty, list(zip(times, range(len(times)), strict=True))) == expected


def test_late_messages_of_a_topic_leave_the_others_of_a_callback_alone(with_fault: WithFault) -> None:
    """Messages of the other topic come in time; those of the topic come late, in calls of their topic."""
    faulty = with_fault(CALLBACK, AnchorKind.ENTRY, "", "message_delay", message="scan", **SPEED, **LATE)
    calls = [(i / 10, (name, i)) for i in range(4) for name in ("speed", "gear")]
    calls += [(0.7, ("gear", 7)), (0.7, ("speed", 7)), (0.7, ("speed", 8)), (0.7, ("gear", 9))]
    expected = [None, ("gear", 0), None, ("gear", 1), ("speed", 0), ("gear", 2), ("speed", 1), ("gear", 3)]
    expected += [("gear", 7), ("speed", 2), ("speed", 3), ("gear", 9)]
    assert run_callback(faulty, calls) == expected


@pytest.mark.parametrize(
    ("model", "more", "expected"),
    [
        ("message_freeze", {}, [[1], [2], [2], [2]]),
        ("message_delay", {"delay": 0.1}, [[1], [], [2], [3]]),
        ("message_reordering", {}, [[1], [], [3, 2], []]),
    ],
)
def test_a_sender_can_fill_the_same_message_again(
    with_fault: WithFault, model: str, more: dict[str, Value], expected: list[list[int]]
) -> None:
    """Messages are copied when they come, so a later content does not replace theirs."""
    source = "def f(queue):\n    return [message['number'] for message in queue]\n"
    faulty, number, message = (
        with_fault(source, AnchorKind.ENTRY, "", model, queue="queue", **more),
        counting(),
        {},
    )

    def send() -> list[dict[str, int]]:
        message["number"] = number()
        return [message]

    assert faulty.run(".xxx", send) == expected


def test_a_late_message_of_a_callback_is_a_copy(with_fault: WithFault) -> None:
    faulty = with_fault(
        "def f(scan):\n    return scan[0]\n", AnchorKind.ENTRY, "", "message_delay", message="scan", **LATE
    )
    ranges = [0.0]

    def scan() -> list[float]:
        ranges[0] += 1.0
        return ranges

    assert faulty.run(".xxxx", scan) == [1.0, None, None, 2.0, 3.0]


def test_the_reader_of_a_frozen_message_can_change_it(with_fault: WithFault) -> None:
    source = "def f(queue):\n    return [message.pop() for message in queue]\n"
    faulty = with_fault(source, AnchorKind.ENTRY, "", "message_freeze", queue="queue")
    assert faulty.run("xx", lambda: [[1, 2]]) == [[2], [2]]


@pytest.mark.parametrize(
    ("model", "more"),
    [
        ("message_loss", {}),
        ("message_freeze", {}),
        ("message_delay", {"delay": 0.1}),
        ("message_repetition", {}),
        ("message_reordering", {}),
    ],
)
def test_a_fault_counts_where_a_message_of_its_topic_comes(
    with_fault: WithFault, model: str, more: dict[str, Value]
) -> None:
    """Readings without such a message, and those outside of the trigger, do not count."""
    faulty = with_fault(READ, AnchorKind.ENTRY, "", model, queue="queue", **SPEED, **more)
    faulty.run("xx", numbered("sped", [1, 1]))
    faulty.run(".", numbered("speed", [1]))
    assert faulty.probe.report()["injections"]["ab12"]["count"] == 0
    faulty.run("xxx", numbered("speed", [0, 2, 0]))
    entry = faulty.probe.report()["injections"]["ab12"]
    assert (entry["count"], entry["first"], entry["last"]) == (1, 0.5, 0.5)


def test_a_fault_of_messages_can_be_limited_to_instances(clone: Workspace) -> None:
    """The probe's check of message faults takes `where` and `every`, as the others do."""
    models = clone.fault_models()
    file = parse_file("m.py", READ.encode(), Path("root"))
    place = FaultLocation(path="m.py", function="f", anchor=Anchor(kind=AnchorKind.ENTRY, name=""))
    lost = Injection(
        location=place, model="message_loss", params=(("queue", "queue"),), where="queue", every=3
    )
    edit = injection_edit(file, models, lost, "ab12")
    data = mutated_bytes(apply_edits(file, as_line_edits(file, [edit])))
    assert b'if _fi.on() and (queue) and _fi.every("ab12", 3) and _fi.listens("ab12"):' in data
    assert unsplice(data) == file.data
