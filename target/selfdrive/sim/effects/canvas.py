"""Drawing thousands of soft specks and streaks at once, and tiles that repeat."""

from collections.abc import Callable

import numpy as np


def splat(
    columns: np.ndarray, rows: np.ndarray, weights: np.ndarray, shape: tuple[int, int], *, wrap: bool
) -> np.ndarray:
    """A float32 picture of `shape` (rows, columns) on which each point's weight is shared among four pixels.

    Points are in pixels, whole numbers being pixel centres. Beyond the border they are dropped or, with
    `wrap`, enter at the other side. The picture's sum is that of the weights drawn.
    """
    height, width = shape
    left, top = np.floor(columns), np.floor(rows)
    if not wrap:  # A frame one pixel wide takes what falls half beside the picture.
        inside = np.flatnonzero((left >= -1.0) & (left < width) & (top >= -1.0) & (top < height))
        left, top, weights = left[inside], top[inside], weights[inside]
        columns, rows = columns[inside], rows[inside]
    right, low = columns - left, weights * (rows - top)
    high = weights - low
    high_right, low_right = high * right, low * right
    shares = high - high_right, high_right, low - low_right, low_right
    left, top = left.astype(np.intp), top.astype(np.intp)
    if wrap:
        left, beside, top, below = left % width, (left + 1) % width, top % height, (top + 1) % height
        places = top * width + left, top * width + beside, below * width + left, below * width + beside
        return _summed(places, shares, shape)
    first = (top + 1) * (width + 2) + left + 1
    places = first, first + 1, first + width + 2, first + width + 3
    return _summed(places, shares, (height + 2, width + 2))[1:-1, 1:-1]


def _summed(places: tuple, shares: tuple, shape: tuple[int, int]) -> np.ndarray:
    picture = np.zeros(shape[0] * shape[1], dtype=np.float32)
    for place, share in zip(places, shares, strict=True):
        np.add.at(picture, place, share.astype(np.float32, copy=False))
    return picture.reshape(shape)


def strokes(
    start: np.ndarray, end: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points evenly along n lines, `counts` (n,) of them on each: (share of the way, columns, rows).

    `start` and `end` are (2, n) px, columns then rows. The points of a line follow each other.
    """
    first = np.cumsum(counts) - counts
    number = np.arange(int(counts.sum()), dtype=np.float32) - np.repeat(first.astype(np.float32) - 0.5, counts)
    step = (end - start) / counts.astype(np.float32)
    columns, rows = [np.repeat(start[axis], counts) + np.repeat(step[axis], counts) * number for axis in (0, 1)]
    return number / np.repeat(counts.astype(np.float32), counts), columns, rows


def seamless(levels: np.ndarray, margin: int, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """A tile changed by a filter reaching `margin` pixels far, such that it still repeats seamlessly."""
    return change(np.pad(levels, margin, mode="wrap"))[margin:-margin, margin:-margin]


class Tile:
    """A grey picture that repeats in both directions and is seen through a window of its own size."""

    def __init__(self, levels: np.ndarray) -> None:
        self._rows, self._width = levels.shape
        self._four = np.tile(levels, (2, 2))

    def moved(self, right: float, down: float) -> np.ndarray:
        """The tile after its content moved by whole pixels nearest to these; a view, not to be written."""
        left, top = -round(right) % self._width, -round(down) % self._rows
        return self._four[top : top + self._rows, left : left + self._width]
