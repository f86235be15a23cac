"""The mutation operators by name."""

from collections.abc import Iterable
from functools import cache

from mutator._common import extension_doors
from mutator.errors import MutatorError
from mutator.model import OPERATOR_FAULTS_MODULE, Fault
from mutator.operators import Operator

_OPERATOR_MODEL_SUFFIXES = ("constant", "drop", "empty", "infix", "prefix", "swap")
ALL_NAME = "all"  # stands for the operators with `is_in_all`
OPERATOR_MODELS = (
    *(f"operator_{name}" for name in _OPERATOR_MODEL_SUFFIXES),
    "omission",
)  # fault models that the operators in `all` use


@cache
def find_operator(name: str) -> Operator:
    """Return the operator of that name; MutatorError if there is none, or if its package is broken."""
    operator = extension_doors.OPERATOR_DOOR.load(name)
    assert isinstance(operator, Operator)
    return operator


def names_in_all() -> tuple[str, ...]:
    """Return the operators that `all` stands for."""
    return tuple(name for name in extension_doors.OPERATOR_DOOR.names() if find_operator(name).is_in_all)


def any_needs_types(names: Iterable[str]) -> bool:
    """Return whether one of these operators needs the types of variables in golden runs."""
    return any(find_operator(name).needs_types for name in names)


def operator_name_of(fault: Fault) -> str | None:
    """Return the operator that made a fault, or None if a spec did. Names of specs contain no `::`."""
    return fault.fault_type if fault.module == OPERATOR_FAULTS_MODULE and "::" in fault.spec else None


def unique_operator_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return the names without duplicates, with those that `all` stands for.

    MutatorError for an unknown name or an empty list.
    """
    named = (each for name in names for each in (names_in_all() if name == ALL_NAME else (name,)))
    unique_names = tuple(dict.fromkeys(named))
    for name in unique_names:
        find_operator(name)
    if not unique_names:
        expected = ", ".join(extension_doors.OPERATOR_DOOR.names())
        raise MutatorError("no operator", argument="operators", expected=f"one or more of {expected}")
    return unique_names
