"""Fits a cubic in compiled C, if available."""

import ctypes
from array import array
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

from selfdrive.common import compiled
from selfdrive.controls.lib.cubic_fit import N_POINTS, POWERS, CubicFit, weights
from selfdrive.controls.lib.polynomial import Poly

C_SOURCE = Path(__file__).with_name("cubic_fit.c")


def build_fit() -> CubicFit:
    library = compiled.library(C_SOURCE)
    return CompiledFit(library) if library else CubicFit()


class CompiledFit(CubicFit):
    """CubicFit that calls `cubic_fit.c`."""

    def __init__(self, library: compiled.Library) -> None:
        self._fit = library.code.fit
        self._fit.restype = None
        self._points, self._poly = array("d", bytes(8 * N_POINTS)), array("d", bytes(8 * len(POWERS)))
        arrays = array("d", chain(*weights(N_POINTS))), self._points, self._poly
        self._buffers = [ctypes.c_double.from_buffer(values) for values in arrays]
        of, points, poly = (ctypes.c_void_p(ctypes.addressof(first)) for first in self._buffers)
        self._arguments = of, points, ctypes.c_long(N_POINTS), poly

    def __call__(self, points: Sequence[float]) -> Poly:
        try:
            self._points[:] = array("d", points)
        except (TypeError, OverflowError, BufferError):  # a fault can replace or drop points
            return super().__call__(points)
        self._fit(*self._arguments)
        a, b, c, d = self._poly
        return a, b, c, d
