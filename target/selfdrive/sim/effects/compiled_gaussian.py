"""The Gaussian blur in compiled C, if available and identical to OpenCV."""

import ctypes
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from selfdrive.common import compiled
from selfdrive.sim.effects.gaussian import Gaussian

C_SOURCE = Path(__file__).with_name("gaussian.c")
MOST_REACH = 32  # px, largest kernel radius
ONE = 256  # sum of a kernel's weights


def build_gaussian(sigma: float, size: int = 0) -> Gaussian:
    library = compiled.library(C_SOURCE)
    if library is None or not agrees(library, sigma, size):
        return Gaussian(sigma, size)
    return CompiledGaussian(library, sigma, size)


class CompiledGaussian(Gaussian):
    """Gaussian that calls the compiled `gaussian.c`."""

    def __init__(self, library: compiled.Library, sigma: float, size: int) -> None:
        super().__init__(sigma, size)
        self.calculated_by = library.digest.hex()
        pointer, number = ctypes.c_void_p, ctypes.c_long
        self._blur = library.code.gaussian
        self._blur.argtypes = [pointer, *[number] * 3, pointer, number, pointer, pointer]
        self._blur.restype = None
        self._kernel = weights(sigma, self.size)

    def __call__(self, picture: np.ndarray) -> np.ndarray:
        rows, columns = picture.shape
        reach = self.size // 2
        if min(rows, columns) <= reach or reach > MOST_REACH:  # mirrored more than once, or too large
            return super().__call__(picture)
        if picture.strides[1] != 1:
            picture = np.ascontiguousarray(picture)
        out = np.empty(picture.shape, np.uint8)
        room = np.empty((2 * self.size + 2) * (columns + 2 * reach + 64), np.uint16)
        arrays = self._kernel.ctypes.data, reach, room.ctypes.data, out.ctypes.data
        self._blur(picture.ctypes.data, picture.strides[0], rows, columns, *arrays)
        return out


def weights(sigma: float, size: int) -> np.ndarray:
    """Integer weights with the sum ONE, from the kernel's edge to its middle; the other half is the same.

    They are rounded like OpenCV's: each passes its rounding error to the next.
    """
    of_edge, lost, middle = [], 0.0, ONE
    for weight in cv2.getGaussianKernel(size, sigma, cv2.CV_64F)[: size // 2, 0].tolist():
        exact = ONE * weight + lost
        of_edge.append(round(exact))
        lost = exact - of_edge[-1]
        middle -= 2 * of_edge[-1]
    return np.array([*of_edge, middle], np.uint16)


@cache
def agrees(library: compiled.Library, sigma: float, size: int) -> bool:
    """Whether compiled code gives the installed OpenCV's bits with this kernel; versions can differ."""
    fast, plain = CompiledGaussian(library, sigma, size), Gaussian(sigma, size)
    noise = (np.arange(48 * 72) * 40503 % 65521 % 256).astype(np.uint8).reshape(48, 72)
    return all(np.array_equal(fast(one), plain(one)) for one in (noise, (noise > 127) * np.uint8(255)))
