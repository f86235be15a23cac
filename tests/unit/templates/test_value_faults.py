"""The effects of fault models on values, step by step."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.model import AnchorKind, Value
from tests.unit.templates.function_with_fault import WithFault, counting


@pytest.mark.parametrize(
    ("kind", "name"),
    [(AnchorKind.AFTER_ASSIGN, "y"), (AnchorKind.ASSIGNED_VALUE, "y"), (AnchorKind.VALUE, "x")],
)
def test_a_stale_value_is_two_steps_old(with_fault: WithFault, kind: AnchorKind, name: str) -> None:
    """Until a value is two steps old, the first value is used. Each active period starts anew."""
    params = {"target": "y"} if kind is AnchorKind.AFTER_ASSIGN else {}
    faulty = with_fault("def f(x):\n    y = x\n    return y\n", kind, name, "stale", steps=2, **params)
    assert faulty.run(".xxxx.xx", counting()) == [1, 2, 2, 2, 3, 6, 7, 7]


def test_staleness_is_counted_in_steps_and_not_in_executions(with_fault: WithFault) -> None:
    faulty = with_fault("def f(x):\n    return x\n", AnchorKind.RETURN_VALUE, "x", "stale", steps=1)
    count, f = counting(), faulty.names["f"]
    faulty.names["f"] = lambda x: (f(x), f(count()))
    assert faulty.run("xxx", count) == [(1, 1), (2, 2), (4, 4)]


def test_the_drift_of_an_expression_grows_with_each_active_step(with_fault: WithFault) -> None:
    source = "def f(x):\n    return x\n"
    faulty = with_fault(source, AnchorKind.RETURN_VALUE, "", "drift", per_step=0.5)
    assert faulty.run(".xx.x", lambda: 1) == [1, 1.5, 2.0, 1, 2.5]
    with pytest.raises(MutatorError, match="an error that stays needs a statement"):
        with_fault(source, AnchorKind.RETURN_VALUE, "", "drift", per_step=0.5, stays=True)


@pytest.mark.parametrize(
    ("model", "params", "message"),
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
    with_fault: WithFault, model: str, params: dict[str, Value], message: str
) -> None:
    with pytest.raises(MutatorError, match=message):
        with_fault("def f(x):\n    return x\n", AnchorKind.RETURN_VALUE, "", model, **params)


@pytest.mark.parametrize(
    ("value", "index"), [(b"ab", 2), (b"ab", -3), (b"", 0), ("ab", 0), (3, 0), (bytearray(), 0)]
)
def test_a_missing_byte_is_an_error(with_fault: WithFault, value: Any, index: int) -> None:
    """Otherwise, the value would silently stay unchanged."""
    faulty = with_fault(
        "def f(x):\n    return x\n", AnchorKind.RETURN_VALUE, "", "byte_corruption", index=index, mask=1
    )
    with pytest.raises(ValueError, match=f"has no byte {index} to corrupt"):
        faulty.run("x", lambda: value)


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
def test_what_a_fault_remembers_is_not_updated_in_place(with_fault: WithFault, kind: str, model: str) -> None:
    """A program can fill the same array in each step, and change what it got back."""
    reading, update, first = IN_PLACE[kind]
    params, marks, expected = MEMORIES[model]
    reading = deepcopy(reading)
    faulty = with_fault(
        "def f(scan):\n    x = scan\n    return x\n",
        AnchorKind.AFTER_ASSIGN,
        "x",
        model,
        target="x",
        **params,
    )
    results = []
    for number, mark in enumerate(marks, 1):
        update(reading, number)
        (result,) = faulty.run(mark, lambda: reading)
        results.append(first(result))
        if mark == "x":
            update(result, 99)
    assert results == expected


def test_what_cannot_be_copied_is_refused_by_name(with_fault: WithFault) -> None:
    faulty = with_fault(
        "def f(x):\n    y = x\n    return y\n", AnchorKind.AFTER_ASSIGN, "y", "stuck", target="y"
    )
    with pytest.raises(TypeError, match="generator cannot be copied to repeat it later: "):
        faulty.run("x", lambda: (number for number in ()))
