"""The mutation operators by name."""

from collections.abc import Iterable
from functools import cache

from mutator._common import doors
from mutator.errors import MutatorError
from mutator.model import OPERATORS, Fault
from mutator.operators import Operator

_OWN = ("constant", "drop", "empty", "infix", "prefix", "swap")
MODELS = (*(f"operator_{name}" for name in _OWN), "omission")  # fault models that shipped operators use


@cache
def find_operator(name: str) -> Operator:
    """Return the operator of that name; MutatorError if there is none, or if its package is broken."""
    found = doors.OPERATORS.find(name)
    assert isinstance(found, Operator)
    return found


def operator_of(fault: Fault) -> str | None:
    """Return the operator that made a fault, or None if a spec did. Names of specs contain no `::`."""
    return fault.fault_type if fault.module == OPERATORS and "::" in fault.spec else None


def operators_named(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names without duplicates; MutatorError for an unknown name or an empty list."""
    found = tuple(dict.fromkeys(names))
    for name in found:
        find_operator(name)
    if not found:
        known = ", ".join(doors.OPERATORS.names())
        raise MutatorError("no operator", argument="operators", expected=f"one or more of {known}")
    return found
