"""Check arguments of the Python API; errors name the argument."""

import math

from mutator.errors import MutatorError


def check_whole_number(argument: str, value: object, *, least: int = 0) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        expected = "a positive number" if least == 1 else f"a whole number, at least {least}"
        raise MutatorError(repr(value), argument=argument, expected=expected)


def check_number(argument: str, value: object, *, least: float = -math.inf) -> None:
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float)
        or not _is_finite_and_at_least(value, least)
    ):
        expected = "a number" if least == -math.inf else f"a number, at least {least:g}"
        raise MutatorError(repr(value), argument=argument, expected=expected)


def check_type(argument: str, value: object, kind: type, expected: str) -> None:
    """Raise MutatorError unless `value` has the type `kind`; `expected` describes it in the error."""
    if not isinstance(value, kind):
        raise MutatorError(repr(value), argument=argument, expected=expected)


def _is_finite_and_at_least(value: float, least: float) -> bool:
    try:
        return math.isfinite(value) and value >= least
    except OverflowError:  # a whole number that is too large for a float
        return False
