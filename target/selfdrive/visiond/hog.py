"""Histograms of oriented gradients (N. Dalal and B. Triggs, 2005), for a whole picture at once.

Cells of 4 x 4 pixels, nine unsigned orientations, blocks of 2 x 2 cells, L2 normalised; each pixel's gradient
votes with its length for one orientation. Detection windows of 32 x 32 pixels share cells and blocks.
"""

from dataclasses import dataclass
from math import atan2, pi

import cv2
import numpy as np

CELL = 4  # pixels
BINS = 9
WINDOW = 32  # pixels
STRIDE = 16  # pixels between windows
WINDOW_BLOCKS = WINDOW // CELL - 1  # blocks of 2 x 2 cells in a window, each way
BLOCK_FEATURES = 4 * BINS
FEATURES = WINDOW_BLOCKS * WINDOW_BLOCKS * BLOCK_FEATURES

_TINY = 1e-10  # prevents division by zero in empty blocks
_STEPS = 511  # possible differences of two grey levels, -255..255
_CODE = np.array(
    [[0, -_STEPS, 0], [-1, 0, 1], [0, _STEPS, 0]], np.float32
)  # all sums are exact in single precision


@dataclass(frozen=True, slots=True)
class _Tables:
    """Orientation and length of every possible gradient, at (dy + 255) * 511 + dx + 255."""

    orientation: np.ndarray  # uint8, so that the table fits into the processor's cache
    length: np.ndarray  # divided by the pixels of a cell, so that a cell's sum is its mean


def _tables() -> _Tables:
    """Calculate the tables for a quarter of the gradients and mirror them."""
    step = np.arange(_STEPS // 2 + 1)
    dx, dy = step[np.newaxis, :], step[:, np.newaxis]
    angle = np.array([[atan2(y, x) for x in range(_STEPS // 2 + 1)] for y in range(_STEPS // 2 + 1)])
    orientation = (angle * (BINS / pi)).astype(np.uint8)
    mirrored = BINS - 1 - orientation
    mirrored[0] = 0  # for a horizontal gradient, left equals right, because orientations are unsigned
    down = np.hstack((mirrored[:, :0:-1], orientation))
    length = np.sqrt(dx * dx + dy * dy) / CELL**2
    length = np.hstack((length[:, :0:-1], length))
    return _Tables(np.vstack((down[:0:-1, ::-1], down)).ravel(), np.vstack((length[:0:-1], length)).ravel())


class Hog:
    """Computes the blocks of pictures of one size, a multiple of a cell's.

    Memory is reused, because allocating it takes as long as the calculation.
    """

    calculated_by = ""

    def __init__(self, rows: int, width: int) -> None:
        self._cells = rows // CELL, width // CELL
        row, column = np.ogrid[:rows, :width]
        cell = (row // CELL) * self._cells[1] + column // CELL
        self._first_bin = np.ascontiguousarray(cell * BINS).ravel()
        self._tables = _tables()
        self._code, self._bins = np.empty((rows, width), np.intp), np.empty(rows * width, np.intp)
        self._lengths = np.empty(rows * width)
        self._blocks = np.empty((self._cells[0] - 1, self._cells[1] - 1, 2, 2 * BINS), np.float32)

    def blocks(self, picture: np.ndarray) -> np.ndarray:
        """Return normalised blocks (rows, columns, 36), float32, of a uint8 picture; the next call overwrites
        them."""
        cells = self._votes(picture)
        power = (cells * cells).sum(axis=2)
        power = power[:-1] + power[1:]
        scale = 1.0 / np.sqrt(power[:, :-1] + power[:, 1:] + np.float32(_TINY))
        self._scaled(cells, scale)
        return self._blocks.reshape(*scale.shape, BLOCK_FEATURES)

    def _votes(self, picture: np.ndarray) -> np.ndarray:
        self._code[...] = _gradient_codes(picture)
        code = self._code.ravel()  # all in range: "wrap" only saves a copy
        bins = np.add(self._tables.orientation.take(code), self._first_bin, out=self._bins)
        lengths = self._tables.length.take(code, out=self._lengths, mode="wrap")
        votes = np.bincount(bins, lengths, self._cells[0] * self._cells[1] * BINS)
        return votes.astype(np.float32).reshape(*self._cells, BINS)

    def _scaled(self, cells: np.ndarray, scale: np.ndarray) -> None:
        down, right, one = cells.strides
        pairs = np.lib.stride_tricks.as_strided(cells, (*scale.shape, 2, 2 * BINS), (down, right, down, one))
        np.multiply(pairs, scale[:, :, np.newaxis, np.newaxis], out=self._blocks)


def windows(blocks: np.ndarray) -> np.ndarray:
    """View (rows, columns, 7, 252) of the windows in `blocks`: per window, seven rows of seven blocks."""
    step = STRIDE // CELL
    rows, columns = ((size - WINDOW_BLOCKS) // step + 1 for size in blocks.shape[:2])
    down, right, one = blocks.strides
    return np.lib.stride_tricks.as_strided(
        blocks,
        (rows, columns, WINDOW_BLOCKS, WINDOW_BLOCKS * BLOCK_FEATURES),
        (step * down, step * right, down, one),
        writeable=False,
    )


def _gradient_codes(picture: np.ndarray) -> np.ndarray:
    """Index of each pixel's gradient (central differences, 0 at the border) in the tables, float32."""
    return cv2.filter2D(picture, cv2.CV_32F, _CODE, delta=_STEPS**2 // 2, borderType=cv2.BORDER_REFLECT_101)
