"""Arithmetic of arrays in a written order: the same bytes whatever the width of the processor's vectors.

Matrix products, and numpy's elementary functions, depend on that width. What is here is made of sums,
products, quotients and roots of single elements, which do not, and of the C library's functions of single
values, which may differ in the last digit on a processor without fused multiplication and addition.
"""

from collections.abc import Callable
from math import log as scalar_log

import numpy as np

_LOG_2 = scalar_log(2.0)
_LOG_TERMS = 10  # the series ends with this power of the square: the next is less than a double's last digit


def product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """The matrix product of two arrays of two dimensions."""
    return (a[:, np.newaxis, :] * b.T).sum(axis=-1)


def dot(a: np.ndarray, b: np.ndarray) -> float:
    """The scalar product of two vectors."""
    return float((a * b).sum())


def length(vectors: np.ndarray) -> np.ndarray:
    """Of vectors along the last axis, which stays, with one element."""
    return np.sqrt((vectors * vectors).sum(axis=-1, keepdims=True))


def each(function: Callable[[float], float], values: np.ndarray) -> np.ndarray:
    """A function of `math` of each value, one at a time and so slowly: float64 of the shape of `values`."""
    found = np.fromiter(map(function, values.ravel().tolist()), float, values.size)
    return found.reshape(values.shape)


def log(values: np.ndarray) -> np.ndarray:
    """Natural logarithm of positive numbers, float64, to the last digits of their type: 2 artanh((m - 1) /
    (m + 1)) of the mantissa, and its power of two."""
    mantissa, power = np.frexp(values)
    small = mantissa < np.sqrt(0.5)
    mantissa, power = np.where(small, 2.0 * mantissa, mantissa), power - small
    ratio = (mantissa - 1.0) / (mantissa + 1.0)
    square = ratio * ratio
    series = np.zeros_like(square)
    for k in range(_LOG_TERMS, -1, -1):
        series *= square
        series += 2.0 / (2 * k + 1)
    return series * ratio + power * values.dtype.type(_LOG_2)
