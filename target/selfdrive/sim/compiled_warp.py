"""Warps a region in compiled C, if available and identical to OpenCV."""

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.sim.picture import Region
from selfdrive.sim.warp import VECTOR_COLUMNS, warp

C_SOURCE = Path(__file__).with_name("warp.c")
COMPARED_PROBE_REGION = Region(0, 48, 0, 512)

WarpFunction = Callable[[np.ndarray, np.ndarray, Region], np.ndarray]


def build_warp() -> tuple[WarpFunction, str]:
    """Return a function like `warp`, in C if possible, and the digest of its compiled code, if any."""
    library = compiled.library(C_SOURCE)
    if library is None or not has_identical_warp(library):
        return warp, ""
    return CompiledWarp(library), library.digest.hex()


class CompiledWarp:
    """`warp` in the compiled `warp.c`."""

    def __init__(self, library: compiled.Library) -> None:
        pointer, number = ctypes.c_void_p, ctypes.c_long
        self._warp = library.code.warp
        self._warp.argtypes = [pointer, number, number, pointer, *[number] * 4, pointer]
        self._warp.restype = None

    def __call__(self, source: np.ndarray, matrix: np.ndarray, region: Region) -> np.ndarray:
        rows, width = source.shape
        # OpenCV calculates the rest of a row, after whole vectors, differently.
        if (
            source.dtype != np.uint8
            or matrix.dtype != float
            or region.right > width // VECTOR_COLUMNS * VECTOR_COLUMNS
        ):
            return warp(source, matrix, region)
        source, matrix = np.ascontiguousarray(source), np.ascontiguousarray(matrix)
        out = np.empty(region.shape, np.uint8)
        self._warp(source.ctypes.data, rows, width, matrix.ctypes.data, *region, out.ctypes.data)
        return out


@cache
def has_identical_warp(library: compiled.Library) -> bool:
    """Whether compiled code gives the installed OpenCV's bits; versions without fused sums differ."""
    noise = (np.arange(48 * 8192) * 40503 % 65521 % 256).astype(np.uint8).reshape(48, 8192)
    matrix = np.array([(1.7, 31.3, 3007.3), (1.3e-3, 0.93, 0.4), (3.1e-5, 1.7e-4, 1.1)])
    return np.array_equal(
        CompiledWarp(library)(noise, matrix, COMPARED_PROBE_REGION),
        warp(noise, matrix, COMPARED_PROBE_REGION),
    )
