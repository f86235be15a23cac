"""Draws many soft specks and streaks at once, and moves pictures that repeat like tiles."""

from collections.abc import Callable

import numpy as np

from selfdrive.sim.picture import Picture, Region


def splat(picture: np.ndarray, columns: np.ndarray, rows: np.ndarray, weights: np.ndarray) -> None:
    """Add each point's weight to the four nearest pixels of `picture` (float32, contiguous).

    Points are in pixels; integers are pixel centres. Points beyond the border wrap around.
    """
    height, width = picture.shape
    left, top = np.floor(columns), np.floor(rows)
    right, low = columns - left, weights * (rows - top)
    high = weights - low
    high_right, low_right = high * right, low * right
    shares = high - high_right, high_right, low - low_right, low_right
    left, top = left.astype(np.intp), top.astype(np.intp)
    left, beside, top, below = left % width, (left + 1) % width, top % height, (top + 1) % height
    top, below = top * width, below * width
    flat = picture.reshape(-1)
    for places, share in zip((top + left, top + beside, below + left, below + beside), shares, strict=True):
        np.add.at(flat, places, share.astype(np.float32, copy=False))


def strokes(
    start: np.ndarray, end: np.ndarray, counts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points along n lines, evenly spaced, `counts` (n,) on each: (share of the way, columns, rows).

    `start` and `end` are (2, n) px, columns then rows. Points are ordered by line.
    """
    lengths = counts.astype(np.float32)
    first = np.repeat((np.cumsum(counts) - counts).astype(np.float32), counts)
    number = np.arange(first.size, dtype=np.float32) - first + np.float32(0.5)
    step = (end - start) / lengths
    columns, rows = (np.repeat(start[k], counts) + np.repeat(step[k], counts) * number for k in (0, 1))
    return number / np.repeat(lengths, counts), columns, rows


def seamless(levels: np.ndarray, margin: int, change: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
    """Apply a filter with a radius of `margin` pixels to a tile, so that it still repeats seamlessly."""
    return change(np.pad(levels, margin, mode="wrap"))[margin:-margin, margin:-margin]


def filtered(
    picture: np.ndarray | Picture, region: Region, margin: int, change: Callable[[np.ndarray], np.ndarray]
) -> np.ndarray:
    """Apply a filter with a radius of at most `margin` pixels to a region of a picture."""
    wide = region.around(margin, picture.shape)
    return change(picture[wide.part])[region.inside(wide)]


class Tile:
    """A grey picture that repeats in both directions, seen through a window of its size."""

    def __init__(self, levels: np.ndarray) -> None:
        self._rows, self._width = levels.shape
        self._four = np.tile(levels, (2, 2))

    def moved(self, right: float, down: float, region: Region) -> np.ndarray:
        """A region of the window, after moving the content by whole pixels (rounded); read-only."""
        left, top = -round(right) % self._width, -round(down) % self._rows
        return self._four[top + region.top : top + region.bottom, left + region.left : left + region.right]
