"""Histograms of oriented gradients (N. Dalal and B. Triggs, 2005), for a whole picture at once.

Cells of 4 x 4 pixels, nine unsigned orientations, blocks of 2 x 2 cells, L2 normalised; each pixel's gradient
votes with its length for one orientation. Detection windows of 32 x 32 pixels share cells and blocks.
"""

from dataclasses import dataclass
from math import atan2, pi

import cv2
import numpy as np

CELL_PIXELS = 4  # pixels
ORIENTATION_BINS = 9  # of 20 degrees
WINDOW_PIXELS = 32  # pixels
WINDOW_STRIDE = 16  # pixels between windows
WINDOW_BLOCKS = WINDOW_PIXELS // CELL_PIXELS - 1  # blocks of 2 x 2 cells in a window, each way
BLOCK_FEATURES = 4 * ORIENTATION_BINS
WINDOW_FEATURES = WINDOW_BLOCKS * WINDOW_BLOCKS * BLOCK_FEATURES

_EMPTY_BLOCK_POWER = 1e-10  # prevents division by zero in empty blocks
_DIFFERENCE_STEPS = 511  # possible differences of two grey levels, -255..255
_GRADIENT_CODE_KERNEL = np.array(
    [[0, -_DIFFERENCE_STEPS, 0], [-1, 0, 1], [0, _DIFFERENCE_STEPS, 0]], np.float32
)  # all sums are exact in single precision


@dataclass(frozen=True, slots=True)
class _GradientTables:
    """Orientation and length of every possible gradient, at (dy + 255) * 511 + dx + 255."""

    orientation: np.ndarray  # uint8, so that the table fits into the processor's cache
    length: np.ndarray  # divided by the pixels of a cell, so that a cell's sum is its mean


def _build_tables() -> _GradientTables:
    """Calculate the tables for a quarter of the gradients and mirror them."""
    step = np.arange(_DIFFERENCE_STEPS // 2 + 1)
    dx, dy = step[np.newaxis, :], step[:, np.newaxis]
    angle = np.array(
        [[atan2(y, x) for x in range(_DIFFERENCE_STEPS // 2 + 1)] for y in range(_DIFFERENCE_STEPS // 2 + 1)]
    )
    orientation = (angle * (ORIENTATION_BINS / pi)).astype(np.uint8)
    mirrored = ORIENTATION_BINS - 1 - orientation
    mirrored[0] = 0  # for a horizontal gradient, left equals right, because orientations are unsigned
    down = np.hstack((mirrored[:, :0:-1], orientation))
    length = np.sqrt(dx * dx + dy * dy) / CELL_PIXELS**2
    length = np.hstack((length[:, :0:-1], length))
    return _GradientTables(
        np.vstack((down[:0:-1, ::-1], down)).ravel(), np.vstack((length[:0:-1], length)).ravel()
    )


class Hog:
    """Computes the blocks of pictures of one size, a multiple of a cell's.

    Memory is reused, because allocating it takes as long as the calculation.
    """

    calculated_by = ""

    def __init__(self, rows: int, width: int) -> None:
        self._cells = rows // CELL_PIXELS, width // CELL_PIXELS
        row, column = np.ogrid[:rows, :width]
        cell = (row // CELL_PIXELS) * self._cells[1] + column // CELL_PIXELS
        self._first_bin = np.ascontiguousarray(cell * ORIENTATION_BINS).ravel()
        self._tables = _build_tables()
        self._code, self._bins = np.empty((rows, width), np.intp), np.empty(rows * width, np.intp)
        self._lengths = np.empty(rows * width)
        self._blocks = np.empty((self._cells[0] - 1, self._cells[1] - 1, 2, 2 * ORIENTATION_BINS), np.float32)

    def blocks(self, picture: np.ndarray) -> np.ndarray:
        """Return normalised blocks (rows, columns, 36), float32, of a uint8 picture; the next call overwrites
        them."""
        cells = self._vote_by_cell(picture)
        power = (cells * cells).sum(axis=2)
        power = power[:-1] + power[1:]
        scale = 1.0 / np.sqrt(power[:, :-1] + power[:, 1:] + np.float32(_EMPTY_BLOCK_POWER))
        self._normalise_blocks(cells, scale)
        return self._blocks.reshape(*scale.shape, BLOCK_FEATURES)

    def _vote_by_cell(self, picture: np.ndarray) -> np.ndarray:
        self._code[...] = _gradient_codes(picture)
        code = self._code.ravel()  # all in range: "wrap" only saves a copy
        bins = np.add(self._tables.orientation.take(code), self._first_bin, out=self._bins)
        lengths = self._tables.length.take(code, out=self._lengths, mode="wrap")
        votes = np.bincount(bins, lengths, self._cells[0] * self._cells[1] * ORIENTATION_BINS)
        return votes.astype(np.float32).reshape(*self._cells, ORIENTATION_BINS)

    def _normalise_blocks(self, cells: np.ndarray, scale: np.ndarray) -> None:
        down, right, column_stride = cells.strides
        pairs = np.lib.stride_tricks.as_strided(
            cells, (*scale.shape, 2, 2 * ORIENTATION_BINS), (down, right, down, column_stride)
        )
        np.multiply(pairs, scale[:, :, np.newaxis, np.newaxis], out=self._blocks)


def detection_windows(blocks: np.ndarray) -> np.ndarray:
    """View (rows, columns, 7, 252) of the windows in `blocks`: per window, seven rows of seven blocks."""
    step = WINDOW_STRIDE // CELL_PIXELS
    rows, columns = ((size - WINDOW_BLOCKS) // step + 1 for size in blocks.shape[:2])
    down, right, feature_stride = blocks.strides
    return np.lib.stride_tricks.as_strided(
        blocks,
        (rows, columns, WINDOW_BLOCKS, WINDOW_BLOCKS * BLOCK_FEATURES),
        (step * down, step * right, down, feature_stride),
        writeable=False,
    )


def _gradient_codes(picture: np.ndarray) -> np.ndarray:
    """Index of each pixel's gradient (central differences, 0 at the border) in the tables, float32."""
    return cv2.filter2D(
        picture,
        cv2.CV_32F,
        _GRADIENT_CODE_KERNEL,
        delta=_DIFFERENCE_STEPS**2 // 2,
        borderType=cv2.BORDER_REFLECT_101,
    )
