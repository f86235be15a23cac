"""Sums in a written order: the same bytes on any Python, which compensates its own sums since 3.12."""

from collections.abc import Iterable
from functools import reduce
from operator import add


def total(values: Iterable[float]) -> float:
    """The sum, added from left to right; 0 if there are no values."""
    return reduce(add, values, 0)
