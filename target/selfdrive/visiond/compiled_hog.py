"""Histograms of oriented gradients with their slow steps in C, where these were compiled."""

import ctypes
from pathlib import Path

import numpy as np

from selfdrive.common import compiled
from selfdrive.visiond.hog import BINS, Hog

C_SOURCE = Path(__file__).with_name("hog.c")


def build_hog(rows: int, width: int) -> Hog:
    """A Hog, compiled where it is to be used and has been."""
    library = compiled.library(C_SOURCE)
    return CompiledHog(rows, width, library) if library else Hog(rows, width)


class CompiledHog(Hog):
    """Does what Hog does: `library` is `hog.c`, compiled."""

    def __init__(self, rows: int, width: int, library: compiled.Library) -> None:
        super().__init__(rows, width)
        self.calculated_by = library.digest.hex()
        code, pointer = library.code, ctypes.c_void_p
        self._c_votes, self._c_blocks = code.votes, code.blocks
        self._c_votes.argtypes = [pointer, ctypes.c_long, ctypes.c_long, *[pointer] * 4]
        self._c_blocks.argtypes = [pointer, pointer, ctypes.c_long, ctypes.c_long, pointer]
        self._c_votes.restype = self._c_blocks.restype = None
        self._size = rows, width
        self._sums = np.empty(self._cells[1] * BINS)
        self._cell_votes = np.empty((*self._cells, BINS), np.float32)

    def _votes(self, picture: np.ndarray) -> np.ndarray:
        if picture.dtype != np.uint8 or picture.shape != self._size:  # a fault may do that to a picture
            return super()._votes(picture)
        picture = np.ascontiguousarray(picture)
        tables, cells = self._tables, self._cell_votes
        arrays = (tables.orientation, tables.length, self._sums, cells)
        self._c_votes(picture.ctypes.data, *self._size, *[array.ctypes.data for array in arrays])
        return cells

    def _scaled(self, cells: np.ndarray, scale: np.ndarray) -> None:
        scale = np.ascontiguousarray(scale)
        self._c_blocks(cells.ctypes.data, scale.ctypes.data, *scale.shape, self._blocks.ctypes.data)
