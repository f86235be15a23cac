"""The effects of fault models on calls, branches and statements, step by step."""

import pytest

from mutator.errors import MutatorError
from mutator.model import AnchorKind, Value
from tests.unit.templates.function_with_fault import STEP_S, WithFault, counting


def test_a_slow_call_returns_its_result_after_its_duration(with_fault: WithFault) -> None:
    faulty = with_fault(
        "def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "slow_call", duration=2 * STEP_S
    )
    count = counting()
    assert faulty.run("..xxxxxx..xxx", lambda: count) == [1, 2, 3, 3, 3, 3, 4, 4, 6, 7, 8, 8, 8]


def test_a_slow_call_that_fails_is_repeated_in_the_next_step(with_fault: WithFault) -> None:
    faulty = with_fault(
        "def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "slow_call", duration=1.0
    )
    with pytest.raises(ZeroDivisionError):
        faulty.run("x", lambda: lambda: 1 / 0)
    assert faulty.run("x", lambda: lambda: 3) == [3]


@pytest.mark.parametrize("kind", [AnchorKind.BEFORE_CALL, AnchorKind.AFTER_CALL])
def test_a_repeated_call_sends_its_message_twice(with_fault: WithFault, kind: AnchorKind) -> None:
    sent: list[int] = []
    faulty = with_fault("def f(x):\n    put(\n        x  # it\n    )\n", kind, "put", "repetition")
    faulty.names["put"] = sent.append
    faulty.run(".x.", counting())
    assert sent == [1, 2, 2, 3]


def test_a_repeated_assignment_sets_only_its_own_names(with_fault: WithFault) -> None:
    faulty = with_fault("def f(x):\n    x += 1\n    return x\n", AnchorKind.AFTER_ASSIGN, "x", "repetition")
    assert faulty.run(".x", lambda: 0) == [1, 2]


def test_a_repeated_expression_uses_its_second_result(with_fault: WithFault) -> None:
    faulty = with_fault("def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "repetition")
    count = counting()
    assert faulty.run(".x.", lambda: count) == [1, 3, 4]


def test_an_omitted_call_sends_no_message(with_fault: WithFault) -> None:
    sent: list[int] = []
    faulty = with_fault("def f(x):\n    put(x)\n", AnchorKind.BEFORE_CALL, "put", "omission")
    faulty.names["put"] = sent.append
    faulty.run(".x.", counting())
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


def test_the_anchored_statement_and_the_next_are_exchanged(with_fault: WithFault) -> None:
    source = REORDERED.replace("y = x", "x = x * 2").replace("y = y +", "y = x +")
    faulty = with_fault(source, AnchorKind.BEFORE_ASSIGN, "x", "reordering")
    assert faulty.run(".x.", lambda: 1) == [12, 11, 12]
    assert (
        "            y = x + 10  # fi:ab12 guard:6\n            x = x * 2  # fi:ab12 guard:6\n" in faulty.text
    )


def test_exchanged_statements_can_raise_an_unbound_local_error(with_fault: WithFault) -> None:
    source = "def f(x):\n    y = x\n    z = y\n    return z\n"
    faulty = with_fault(source, AnchorKind.BEFORE_ASSIGN, "y", "reordering")
    assert faulty.run(".", lambda: 1) == [1]
    with pytest.raises(UnboundLocalError):
        faulty.run(".x", lambda: 1)


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("def f(x):\n    y = x\n", "the next statement is missing"),
        ("def f(x):\n    y = x\n    if x:\n        pass\n", "the next statement is missing"),
        ("def f(x):\n    y = x\n    x += 1; x += 2\n", "the next statement is missing"),
        ("def f(x):\n    y = x; x += 1\n", "alone on its lines"),
        ("def f(x):\n    y = x\n    return '''a\nb'''\n", "a string spans several lines"),
        ("def f(x):\n    y = '''a\nb'''\n    return x\n", "a string spans several lines"),
    ],
)
def test_some_statements_cannot_be_exchanged(with_fault: WithFault, source: str, message: str) -> None:
    with pytest.raises(MutatorError, match=rf"m.py:2: .*{message}"):
        with_fault(source, AnchorKind.BEFORE_ASSIGN, "y", "reordering")


def test_the_entry_of_a_function_cannot_be_repeated(with_fault: WithFault) -> None:
    with pytest.raises(MutatorError, match="not at a statement that is alone on its lines"):
        with_fault("def f(x):\n    return x\n", AnchorKind.ENTRY, "", "repetition")


def test_a_return_statement_cannot_be_repeated(with_fault: WithFault) -> None:
    with pytest.raises(MutatorError, match=r"`return g\(x\)` ends its block"):
        with_fault("def f(x):\n    return g(x)\n", AnchorKind.BEFORE_CALL, "g", "repetition")


def test_two_arguments_are_swapped(with_fault: WithFault) -> None:
    source = "def f(x):\n    return dict(a=x, b=x + 1, c=(x == 1))\n"
    faulty = with_fault(source, AnchorKind.RESULT, "dict", "swapped_arguments", first=1, second=3)
    assert faulty.run(".x", lambda: 1) == [{"a": 1, "b": 2, "c": True}, {"a": True, "b": 2, "c": 1}]


@pytest.mark.parametrize(
    ("call", "first", "second"),
    [("g(x)", 1, 2), ("g(x, y)", 2, 2), ("g(x, *y)", 1, 2), ("g(x, **y)", 2, 1), ("g()", 1, 2)],
)
def test_only_two_different_arguments_without_stars_can_be_swapped(
    with_fault: WithFault, call: str, first: int, second: int
) -> None:
    with pytest.raises(MutatorError, match="expected two different arguments, counted from 1, without stars"):
        with_fault(
            f"def f(x, y):\n    return {call}\n",
            AnchorKind.RESULT,
            "g",
            "swapped_arguments",
            first=first,
            second=second,
        )


@pytest.mark.parametrize("model", ["slow_call", "swapped_arguments"])
@pytest.mark.parametrize(("kind", "name"), [(AnchorKind.VALUE, "x + 1"), (AnchorKind.AFTER_ASSIGN, "y")])
def test_a_model_of_a_call_needs_a_call_anchor(
    with_fault: WithFault, model: str, kind: AnchorKind, name: str
) -> None:
    params: dict[str, Value] = {"duration": 1.0} if model == "slow_call" else {"first": 1, "second": 2}
    with pytest.raises(
        MutatorError, match=rf"m.py:2: model {model} does not fit .*; expected a call: an anchor `result`"
    ):
        with_fault("def f(x):\n    y = x + 1\n    return y\n", kind, name, model, target="y", **params)


@pytest.mark.parametrize(
    ("holds", "returned"), [("inverted", [1, 2, 2]), ("always", [1, 1, 1]), ("never", [2, 2, 2])]
)
def test_a_branch_condition_is_evaluated_then_negated_or_fixed(
    with_fault: WithFault, holds: str, returned: list[int]
) -> None:
    evaluated: list[int] = []
    source = "def f(x):\n    if ask(x):\n        return 1\n    return 2\n"
    faulty = with_fault(source, AnchorKind.CONDITION, "ask(x)", "wrong_branch", holds=holds)
    faulty.names["ask"] = lambda x: evaluated.append(x) or x > 1
    count = counting()
    assert faulty.run("xxx", count) == returned and evaluated == [1, 2, 3]
    assert faulty.run("..", counting()) == [2, 1]


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        (AnchorKind.ENTRY, ""),
        (AnchorKind.BEFORE_RETURN, "x"),
        (AnchorKind.RETURN_VALUE, ""),
        (AnchorKind.VALUE, "x"),
    ],
)
def test_an_exception_is_raised_while_the_fault_is_active(
    with_fault: WithFault, kind: AnchorKind, name: str
) -> None:
    faulty = with_fault("def f(x):\n    return x\n", kind, name, "exception", error="TimeoutError")
    assert faulty.run(".", lambda: 1) == [1]
    with pytest.raises(TimeoutError, match="injected fault"):
        faulty.run(".x", lambda: 1)


def test_a_call_returns_none_while_the_fault_is_active(with_fault: WithFault) -> None:
    faulty = with_fault("def f(get):\n    return get()\n", AnchorKind.RESULT, "get", "none")
    count = counting()
    assert faulty.run(".x.", lambda: count) == [1, None, 3]


def test_the_result_of_a_slow_call_is_not_updated_in_place(with_fault: WithFault) -> None:
    source = "def f(read):\n    x = read()\n    return x[0]\n"
    faulty = with_fault(source, AnchorKind.RESULT, "read", "slow_call", duration=0.2)
    buffer, numbers = [0], iter(range(1, 9))

    def read() -> list[int]:
        buffer[0] = next(numbers)
        return buffer

    assert faulty.run("--xxxx", lambda: read) == [1, 2, 3, 3, 3, 3]
