"""The mutation operators by name."""

from collections.abc import Iterable
from enum import StrEnum

from mutator._common.text import suggestion
from mutator.errors import MutatorError
from mutator.model import OPERATORS, Fault

_OWN = ("constant", "drop", "empty", "infix", "prefix", "swap")
MODELS = (*(f"operator_{name}" for name in _OWN), "omission")  # fault models that operators use


class Operator(StrEnum):
    """The mutation operators. If two of them make the same change, it belongs to the first."""

    ARITHMETIC = "arithmetic"
    COMPARISON = "comparison"
    CONSTANT = "constant"
    BRANCH = "branch"
    OMISSION = "omission"
    RETURN = "return"
    ARGUMENT = "argument"


def operator_of(fault: Fault) -> Operator | None:
    """Return the operator that made a fault, or None if a spec did. Names of specs contain no `::`."""
    return Operator(fault.fault_type) if fault.module == OPERATORS and "::" in fault.spec else None


def operators_named(names: Iterable[str]) -> tuple[Operator, ...]:
    """Return the named operators without duplicates; MutatorError for an unknown name or an empty list."""
    known = [one.value for one in Operator]
    found: dict[Operator, None] = {}
    for name in names:
        if name not in known:
            raise MutatorError(
                f"no operator '{name}'",
                argument="operators",
                expected=f"one or more of {', '.join(known)}",
                remedy="correct the name" + suggestion(name, known),
            )
        found[Operator(name)] = None
    if not found:
        raise MutatorError("no operator", argument="operators", expected=f"one or more of {', '.join(known)}")
    return tuple(found)
