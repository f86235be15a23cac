"""The effects of fault models, step by step, on a small function that runs with the probe."""

import types
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.model import Anchor, AnchorKind, FaultLocation, Hold, Injection, Trigger, Value
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.mutants.probe_contract import build_probe_settings, render_probe
from mutator.mutants.splicing import apply_edits, as_line_edits, mutated_bytes, unsplice
from mutator.triggers.conditions import canonical_condition
from mutator.workspace import Workspace

STEP_S = 0.1
Make = Callable[..., "Toy"]


class Toy:
    """A function `f` with one injection. `names` are its globals."""

    def __init__(self, clone: Workspace, source: str, anchor: Anchor, model: str, **params: Value) -> None:
        models = clone.fault_models()
        file = parse_file("m.py", source.encode(), Path("root"))
        place = FaultLocation(path="m.py", function="f", anchor=anchor)
        injection = Injection(location=place, model=model, params=tuple(sorted(params.items())))
        data = mutated_bytes(
            apply_edits(file, as_line_edits(file, [injection_edit(file, models, injection, "ab12")]))
        )
        assert unsplice(data) == file.data
        trigger = Trigger(name="test", condition=canonical_condition("rs > 0"))
        observation = clone.manifest("openpilot").observation
        settings = build_probe_settings("m", trigger, Hold.WHILE, ("ab12",), observation, STEP_S)
        self.text = data.decode()
        self.probe: Any = types.ModuleType("_fi")
        exec(render_probe(models.probe_templates, settings).text, vars(self.probe))
        self.names: dict[str, Any] = {"_fi": self.probe}
        exec(self.text, self.names)
        self.steps = 0

    def run(self, marks: str, *arguments: Any) -> list[Any]:
        """Return the result of `f` in each step. The fault is active in steps marked `x`. Each argument is a
        function that returns the value to pass."""
        found = []
        for mark in marks:
            lead = 15.0 if mark == "x" else 20.0
            self.steps += 1
            self.probe.observe(t=self.steps * STEP_S, d_rel=40.0, v_ego=20.0, v_lead=lead)
            found.append(self.names["f"](*(argument() for argument in arguments)))
        return found


@pytest.fixture
def toy(clone: Workspace) -> Make:
    def make(source: str, kind: AnchorKind, name: str, model: str, /, **params: Value) -> Toy:
        return Toy(clone, source, Anchor(kind=kind, name=name), model, **params)

    return make


def counting() -> Callable[[], int]:
    calls: list[None] = []

    def count() -> int:
        calls.append(None)
        return len(calls)

    return count


@pytest.mark.parametrize(
    ("kind", "name"),
    [(AnchorKind.AFTER_ASSIGN, "y"), (AnchorKind.ASSIGNED_VALUE, "y"), (AnchorKind.VALUE, "x")],
)
def test_a_stale_value_is_two_steps_old(toy: Make, kind: AnchorKind, name: str) -> None:
    """Until a value is two steps old, the first value is used. Each active period starts anew."""
    params = {"target": "y"} if kind is AnchorKind.AFTER_ASSIGN else {}
    made = toy("def f(x):\n    y = x\n    return y\n", kind, name, "stale", steps=2, **params)
    assert made.run(".xxxx.xx", counting()) == [1, 2, 2, 2, 3, 6, 7, 7]


def test_staleness_is_counted_in_steps_and_not_in_executions(toy: Make) -> None:
    made = toy("def f(x):\n    return x\n", AnchorKind.RETURN_VALUE, "x", "stale", steps=1)
    count, f = counting(), made.names["f"]
    made.names["f"] = lambda x: (f(x), f(count()))
    assert made.run("xxx", count) == [(1, 1), (2, 2), (4, 4)]


def test_a_slow_call_returns_its_result_after_its_duration(toy: Make) -> None:
    made = toy("def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "slow_call", duration=2 * STEP_S)
    count = counting()
    assert made.run("..xxxxxx..xxx", lambda: count) == [1, 2, 3, 3, 3, 3, 4, 4, 6, 7, 8, 8, 8]


def test_a_slow_call_that_fails_is_repeated_in_the_next_step(toy: Make) -> None:
    made = toy("def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "slow_call", duration=1.0)
    with pytest.raises(ZeroDivisionError):
        made.run("x", lambda: lambda: 1 / 0)
    assert made.run("x", lambda: lambda: 3) == [3]


@pytest.mark.parametrize("kind", [AnchorKind.BEFORE_CALL, AnchorKind.AFTER_CALL])
def test_a_repeated_call_sends_its_message_twice(toy: Make, kind: AnchorKind) -> None:
    sent: list[int] = []
    made = toy("def f(x):\n    put(\n        x  # it\n    )\n", kind, "put", "repetition")
    made.names["put"] = sent.append
    made.run(".x.", counting())
    assert sent == [1, 2, 2, 3]


def test_a_repeated_assignment_sets_only_its_own_names(toy: Make) -> None:
    made = toy("def f(x):\n    x += 1\n    return x\n", AnchorKind.AFTER_ASSIGN, "x", "repetition")
    assert made.run(".x", lambda: 0) == [1, 2]


def test_a_repeated_expression_uses_its_second_result(toy: Make) -> None:
    made = toy("def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "repetition")
    count = counting()
    assert made.run(".x.", lambda: count) == [1, 3, 4]


def test_an_omitted_call_sends_no_message(toy: Make) -> None:
    sent: list[int] = []
    made = toy("def f(x):\n    put(x)\n", AnchorKind.BEFORE_CALL, "put", "omission")
    made.names["put"] = sent.append
    made.run(".x.", counting())
    assert sent == [1, 3]


REORDERED = """def f(x):
    try:
        y = x

        # the sum of a string
        y = y + (
            10
        )
    finally:
        pass
    return y
"""


def test_the_anchored_statement_and_the_next_are_exchanged(toy: Make) -> None:
    source = REORDERED.replace("y = x", "x = x * 2").replace("y = y +", "y = x +")
    made = toy(source, AnchorKind.BEFORE_ASSIGN, "x", "reordering")
    assert made.run(".x.", lambda: 1) == [12, 11, 12]
    assert (
        "            y = x + 10  # fi:ab12 guard:6\n            x = x * 2  # fi:ab12 guard:6\n" in made.text
    )


def test_exchanged_statements_can_raise_an_unbound_local_error(toy: Make) -> None:
    source = "def f(x):\n    y = x\n    z = y\n    return z\n"
    made = toy(source, AnchorKind.BEFORE_ASSIGN, "y", "reordering")
    assert made.run(".", lambda: 1) == [1]
    with pytest.raises(UnboundLocalError):
        made.run(".x", lambda: 1)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("def f(x):\n    y = x\n", "the next statement is missing"),
        ("def f(x):\n    y = x\n    if x:\n        pass\n", "the next statement is missing"),
        ("def f(x):\n    y = x\n    x += 1; x += 2\n", "the next statement is missing"),
        ("def f(x):\n    y = x; x += 1\n", "alone on its lines"),
        ("def f(x):\n    y = x\n    return '''a\nb'''\n", "a string spans several lines"),
        ("def f(x):\n    y = '''a\nb'''\n    return x\n", "a string spans several lines"),
    ],
)
def test_some_statements_cannot_be_exchanged(toy: Make, source: str, said: str) -> None:
    with pytest.raises(MutatorError, match=rf"m.py:2: .*{said}"):
        toy(source, AnchorKind.BEFORE_ASSIGN, "y", "reordering")


def test_the_entry_of_a_function_cannot_be_repeated(toy: Make) -> None:
    with pytest.raises(MutatorError, match="not at a statement that is alone on its lines"):
        toy("def f(x):\n    return x\n", AnchorKind.ENTRY, "", "repetition")


def test_a_return_statement_cannot_be_repeated(toy: Make) -> None:
    with pytest.raises(MutatorError, match=r"`return g\(x\)` ends its block"):
        toy("def f(x):\n    return g(x)\n", AnchorKind.BEFORE_CALL, "g", "repetition")


def test_two_arguments_are_swapped(toy: Make) -> None:
    source = "def f(x):\n    return dict(a=x, b=x + 1, c=(x == 1))\n"
    made = toy(source, AnchorKind.RESULT, "dict", "swapped_arguments", first=1, second=3)
    assert made.run(".x", lambda: 1) == [{"a": 1, "b": 2, "c": True}, {"a": True, "b": 2, "c": 1}]


@pytest.mark.parametrize(
    ("call", "first", "second"),
    [("g(x)", 1, 2), ("g(x, y)", 2, 2), ("g(x, *y)", 1, 2), ("g(x, **y)", 2, 1), ("g()", 1, 2)],
)
def test_only_two_different_arguments_without_stars_can_be_swapped(
    toy: Make, call: str, first: int, second: int
) -> None:
    with pytest.raises(MutatorError, match="expected two different arguments, counted from 1, without stars"):
        toy(
            f"def f(x, y):\n    return {call}\n",
            AnchorKind.RESULT,
            "g",
            "swapped_arguments",
            first=first,
            second=second,
        )


@pytest.mark.parametrize("model", ["slow_call", "swapped_arguments"])
@pytest.mark.parametrize(("kind", "name"), [(AnchorKind.VALUE, "x + 1"), (AnchorKind.AFTER_ASSIGN, "y")])
def test_a_model_of_a_call_needs_a_call_anchor(toy: Make, model: str, kind: AnchorKind, name: str) -> None:
    params: dict[str, Value] = {"duration": 1.0} if model == "slow_call" else {"first": 1, "second": 2}
    with pytest.raises(
        MutatorError, match=rf"m.py:2: model {model} does not fit .*; expected a call: an anchor `result`"
    ):
        toy("def f(x):\n    y = x + 1\n    return y\n", kind, name, model, target="y", **params)


@pytest.mark.parametrize(
    ("holds", "taken"), [("inverted", [1, 2, 2]), ("always", [1, 1, 1]), ("never", [2, 2, 2])]
)
def test_a_branch_condition_is_evaluated_then_negated_or_fixed(
    toy: Make, holds: str, taken: list[int]
) -> None:
    asked: list[int] = []
    source = "def f(x):\n    if ask(x):\n        return 1\n    return 2\n"
    made = toy(source, AnchorKind.CONDITION, "ask(x)", "wrong_branch", holds=holds)
    made.names["ask"] = lambda x: asked.append(x) or x > 1
    count = counting()
    assert made.run("xxx", count) == taken and asked == [1, 2, 3]
    assert made.run("..", counting()) == [2, 1]


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (AnchorKind.ENTRY, ""),
        (AnchorKind.BEFORE_RETURN, "x"),
        (AnchorKind.RETURN_VALUE, ""),
        (AnchorKind.VALUE, "x"),
    ],
)
def test_an_exception_is_raised_while_the_fault_is_active(toy: Make, kind: AnchorKind, name: str) -> None:
    made = toy("def f(x):\n    return x\n", kind, name, "exception", error="TimeoutError")
    assert made.run(".", lambda: 1) == [1]
    with pytest.raises(TimeoutError, match="injected fault"):
        made.run(".x", lambda: 1)


def test_a_call_returns_none_while_the_fault_is_active(toy: Make) -> None:
    made = toy("def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "none")
    count = counting()
    assert made.run(".x.", lambda: count) == [1, None, 3]


def test_the_drift_of_an_expression_grows_with_each_active_step(toy: Make) -> None:
    source = "def f(x):\n    return x\n"
    made = toy(source, AnchorKind.RETURN_VALUE, "", "drift", per_step=0.5)
    assert made.run(".xx.x", lambda: 1) == [1, 1.5, 2.0, 1, 2.5]
    with pytest.raises(MutatorError, match="an error that stays needs a statement"):
        toy(source, AnchorKind.RETURN_VALUE, "", "drift", per_step=0.5, stays=True)


@pytest.mark.parametrize(
    ("model", "params", "said"),
    [
        ("clamp", {}, "clamp without a bound"),
        (
            "unit_mix_up",
            {"written_in": "m", "read_as": "mps"},
            "written in m, read as mps; expected two different units of length",
        ),
        ("unit_mix_up", {"written_in": "m", "read_as": "m"}, "expected two different units of length"),
        (
            "unit_mix_up",
            {"written_in": "m", "read_as": "feet"},
            "'feet' for 'read_as'; expected one of m, mm",
        ),
        (
            "wrong_branch",
            {"holds": "perhaps"},
            "'perhaps' for 'holds'; expected one of inverted, always, never",
        ),
    ],
)
def test_contradicting_parameters_are_refused(
    toy: Make, model: str, params: dict[str, Value], said: str
) -> None:
    with pytest.raises(MutatorError, match=said):
        toy("def f(x):\n    return x\n", AnchorKind.RETURN_VALUE, "", model, **params)


@pytest.mark.parametrize(
    ("value", "index"), [(b"ab", 2), (b"ab", -3), (b"", 0), ("ab", 0), (3, 0), (bytearray(), 0)]
)
def test_a_missing_byte_is_an_error(toy: Make, value: Any, index: int) -> None:
    """Otherwise, the value would silently stay unchanged."""
    made = toy(
        "def f(x):\n    return x\n", AnchorKind.RETURN_VALUE, "", "byte_corruption", index=index, mask=1
    )
    with pytest.raises(ValueError, match=f"has no byte {index} to corrupt"):
        made.run("x", lambda: value)


class _Scan:
    """A reading that its program updates in place."""

    def __init__(self, number: int) -> None:
        self.ranges = [number]

    def set(self, number: int) -> None:
        self.ranges[0] = number


IN_PLACE = {
    "list": ([0], lambda scan, n: scan.__setitem__(0, n), lambda scan: scan[0]),
    "dict": ({"r": [0]}, lambda scan, n: scan["r"].__setitem__(0, n), lambda scan: scan["r"][0]),
    "array": (np.zeros(2), lambda scan, n: scan.fill(n), lambda scan: int(scan[0])),
    "object": (_Scan(0), _Scan.set, lambda scan: scan.ranges[0]),
}
MEMORIES = {
    "stuck": ({}, "--xxxx", [1, 2, 3, 3, 3, 3]),
    "delay": ({"delay": 0.2}, "--xxxx", [1, 2, 3, 3, 3, 4]),
    "stale": ({"steps": 1}, "--xxxx", [1, 2, 3, 3, 4, 5]),
}


@pytest.mark.parametrize("kind", IN_PLACE)
@pytest.mark.parametrize("model", MEMORIES)
def test_what_a_fault_remembers_is_not_updated_in_place(toy: Make, kind: str, model: str) -> None:
    """A program can fill the same array in each step, and change what it got back."""
    reading, update, first = IN_PLACE[kind]
    params, marks, expected = MEMORIES[model]
    reading = deepcopy(reading)
    made = toy(
        "def f(scan):\n    x = scan\n    return x\n",
        AnchorKind.AFTER_ASSIGN,
        "x",
        model,
        target="x",
        **params,
    )
    found = []
    for number, mark in enumerate(marks, 1):
        update(reading, number)
        (result,) = made.run(mark, lambda: reading)
        found.append(first(result))
        if mark == "x":
            update(result, 99)
    assert found == expected


def test_the_result_of_a_slow_call_is_not_updated_in_place(toy: Make) -> None:
    source = "def f(read):\n    x = read()\n    return x[0]\n"
    made = toy(source, AnchorKind.RESULT, "read", "slow_call", duration=0.2)
    buffer, numbers = [0], iter(range(1, 9))

    def read() -> list[int]:
        buffer[0] = next(numbers)
        return buffer

    assert made.run("--xxxx", lambda: read) == [1, 2, 3, 3, 3, 3]


def test_what_cannot_be_copied_is_refused_by_name(toy: Make) -> None:
    made = toy("def f(x):\n    y = x\n    return y\n", AnchorKind.AFTER_ASSIGN, "y", "stuck", target="y")
    with pytest.raises(TypeError, match="generator cannot be copied to repeat it later: "):
        made.run("x", lambda: (number for number in ()))


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
    toy: Make, model: str, more: dict[str, Value], expected: list[list[int]]
) -> None:
    """Only messages of the topic are changed, only while the fault is active."""
    made = toy(READ, AnchorKind.ENTRY, "", model, queue="queue", **SPEED, **more)
    assert made.run(".xxx.", numbered("speed", [1] * 5)) == expected


def test_messages_overtake_each_other_within_one_reading(toy: Make) -> None:
    made = toy(READ, AnchorKind.ENTRY, "", "message_reordering", queue="queue", **SPEED)
    assert made.run("xx", numbered("speed", [3, 1])) == [[2, 1, 0], [4, 3, 0]]


def test_an_empty_place_in_a_queue_is_no_message(toy: Make) -> None:
    """openpilot's readers put None into the list for a topic without a new message."""
    source = "def f(queue):\n    return queue\n"
    for model in ("message_loss", "message_freeze", "message_repetition", "message_reordering"):
        made = toy(source, AnchorKind.ENTRY, "", model, queue="queue", topic="message.which()", name="speed")
        assert made.run("x", lambda: [None]) == [[None]]


@pytest.mark.parametrize(
    ("model", "more", "expected"),
    [
        ("message_loss", {}, [1, None, None, None, 5]),
        ("message_freeze", {}, [1, 2, 2, 2, 5]),
        ("message_delay", {"delay": 0.1}, [1, None, 2, 3, 5]),
    ],
)
def test_a_callback_gets_no_message_or_another(
    toy: Make, model: str, more: dict[str, Value], expected: list[int | None]
) -> None:
    made = toy(CALLBACK, AnchorKind.ENTRY, "", model, message="scan", **more)
    assert made.run(".xxx.", counting()) == expected


LATE = {"delay": 0.2}


def run_callback(made: Toy, calls: list[tuple[float, Any]]) -> list[Any]:
    """Return what a callback gets in each call, at these times in s; None for a call that ends at once."""
    results, now = [], -1.0
    for time, message in calls:
        if time > now:
            made.probe.observe(t=time, d_rel=40.0, v_ego=20.0, v_lead=15.0)
            now = time
        results.append(made.names["f"](message))
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
    toy: Make, times: list[float], expected: list[int | None]
) -> None:
    """Messages that are due together come one by one, in order; none vanishes."""
    made = toy(CALLBACK, AnchorKind.ENTRY, "", "message_delay", message="scan", **LATE)
    assert run_callback(made, list(zip(times, range(len(times)), strict=True))) == expected


def test_late_messages_of_a_topic_leave_the_others_of_a_callback_alone(toy: Make) -> None:
    """Messages of the other topic come in time; those of the topic come late, in calls of their topic."""
    made = toy(CALLBACK, AnchorKind.ENTRY, "", "message_delay", message="scan", **SPEED, **LATE)
    calls = [(i / 10, (name, i)) for i in range(4) for name in ("speed", "gear")]
    calls += [(0.7, ("gear", 7)), (0.7, ("speed", 7)), (0.7, ("speed", 8)), (0.7, ("gear", 9))]
    expected = [None, ("gear", 0), None, ("gear", 1), ("speed", 0), ("gear", 2), ("speed", 1), ("gear", 3)]
    expected += [("gear", 7), ("speed", 2), ("speed", 3), ("gear", 9)]
    assert run_callback(made, calls) == expected


@pytest.mark.parametrize(
    ("model", "more", "expected"),
    [
        ("message_freeze", {}, [[1], [2], [2], [2]]),
        ("message_delay", {"delay": 0.1}, [[1], [], [2], [3]]),
        ("message_reordering", {}, [[1], [], [3, 2], []]),
    ],
)
def test_a_sender_can_fill_the_same_message_again(
    toy: Make, model: str, more: dict[str, Value], expected: list[list[int]]
) -> None:
    """Messages are copied when they come, so a later content does not replace theirs."""
    source = "def f(queue):\n    return [message['number'] for message in queue]\n"
    made, number, message = toy(source, AnchorKind.ENTRY, "", model, queue="queue", **more), counting(), {}

    def send() -> list[dict[str, int]]:
        message["number"] = number()
        return [message]

    assert made.run(".xxx", send) == expected


def test_a_late_message_of_a_callback_is_a_copy(toy: Make) -> None:
    made = toy(
        "def f(scan):\n    return scan[0]\n", AnchorKind.ENTRY, "", "message_delay", message="scan", **LATE
    )
    ranges = [0.0]

    def scan() -> list[float]:
        ranges[0] += 1.0
        return ranges

    assert made.run(".xxxx", scan) == [1.0, None, None, 2.0, 3.0]


def test_the_reader_of_a_frozen_message_can_change_it(toy: Make) -> None:
    source = "def f(queue):\n    return [message.pop() for message in queue]\n"
    made = toy(source, AnchorKind.ENTRY, "", "message_freeze", queue="queue")
    assert made.run("xx", lambda: [[1, 2]]) == [[2], [2]]


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
    toy: Make, model: str, more: dict[str, Value]
) -> None:
    """Readings without such a message, and those outside of the trigger, do not count."""
    made = toy(READ, AnchorKind.ENTRY, "", model, queue="queue", **SPEED, **more)
    made.run("xx", numbered("sped", [1, 1]))
    made.run(".", numbered("speed", [1]))
    assert made.probe.report()["injections"]["ab12"]["count"] == 0
    made.run("xxx", numbered("speed", [0, 2, 0]))
    entry = made.probe.report()["injections"]["ab12"]
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
