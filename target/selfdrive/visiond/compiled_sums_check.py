"""Compares sums in compiled code with NumPy's."""

import ctypes
from functools import cache

import numpy as np

from selfdrive.common import compiled
from selfdrive.common.array_math import dot


@cache
def has_identical_sums(library: compiled.Library) -> bool:
    """Whether the sums of `sums.h` equal the installed NumPy's; versions can add in a different order."""
    values = np.sqrt(np.arange(1.0, 5001.0))
    room = np.empty_like(values)
    product, pointer = library.code.product, ctypes.c_void_p
    product.argtypes, product.restype = [pointer, pointer, ctypes.c_long, pointer], ctypes.c_double
    address, away = values.ctypes.data, room.ctypes.data
    return all(
        product(address, address, count, away) == dot(values[:count], values[:count])
        for count in (7, 9, 100, 129, 1000, 5000)
    )
