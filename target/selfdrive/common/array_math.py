"""Array arithmetic in a fixed order, so that results do not depend on the processor's vector width.

numpy's own matrix products and elementary functions do depend on it. Functions of `math` can still differ in
the last digit on a processor without fused multiply-add.
"""

from collections.abc import Callable
from math import log as scalar_log

import numpy as np

_LOG_2 = scalar_log(2.0)
_LOG_HIGHEST_POWER = 10  # highest power of the square; the next term is below double precision


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (a[:, np.newaxis, :] * b.T).sum(axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> float:
    return float((a * b).sum())


def vector_lengths(vectors: np.ndarray) -> np.ndarray:
    """The length of each vector along the last axis, which is kept with size 1."""
    return np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))


def each(function: Callable[[float], float], values: np.ndarray) -> np.ndarray:
    """Apply a function of `math` to each value (slow); return float64 of the same shape."""
    found = np.fromiter(map(function, values.ravel().tolist()), float, values.size)
    return found.reshape(values.shape)


def natural_log(values: np.ndarray) -> np.ndarray:
    """Natural logarithm of positive numbers, float64, to double precision: 2 artanh((m - 1) / (m + 1)) of the
    mantissa m, plus the exponent times log 2."""
    mantissa, power = np.frexp(values)
    small = mantissa < np.sqrt(0.5)
    mantissa, power = np.where(small, 2.0 * mantissa, mantissa), power - small
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    square = ratio * ratio
    series = np.zeros_like(square)
    for k in range(_LOG_HIGHEST_POWER, -1, -1):
        series *= square
        series += 2.0 / (2 * k + 1)
    return series * ratio + power * values.dtype.type(_LOG_2)
