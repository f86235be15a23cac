"""Sums in a fixed order, for the same bytes on every Python (`sum` compensates rounding since 3.12)."""

from collections.abc import Iterable
from functools import reduce
from operator import add


def total(values: Iterable[float]) -> float:
    """Return the sum, added from left to right; 0 if there are no values."""
    return reduce(add, values, 0)
