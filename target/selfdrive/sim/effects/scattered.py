"""Light of randomly placed streaks, flakes and droplets, as coded by the paper's authors."""

from typing import NamedTuple

import cv2
import numpy as np

WHITE = 255


class Streak(NamedTuple):
    """Pixels (n, 2) of a streak, column and row relative to its start, and its end; all int_."""

    pixels: np.ndarray
    way: np.ndarray


def streak_light(
    chances: np.ndarray, streak: Streak, levels: np.ndarray, box: np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """Grey levels (uint8) of streaks in a region, of this `shape`, of a canvas.

    `chances` (passes, n, 2), float32, are the starts of streaks as shares of the canvas's columns and rows.
    `box` has the canvas's size, then the region's start. Each pass adds its level (uint8).
    """
    rows, columns = shape
    margin = reach(streak)
    layer = np.empty((rows + 2 * margin, columns + 2 * margin), np.uint8)
    inside = layer[margin:-margin, margin:-margin]
    pixels = streak.pixels[:, 1] * layer.shape[1] + streak.pixels[:, 0]
    light = np.zeros(shape, np.uint8)
    for chance, level in zip(chances, levels, strict=True):
        start = (chance * box[:2]).astype(np.int32) - box[2:]
        end = start + streak.way
        there = (end[:, 0] < columns) & (start[:, 0] >= 0) & (end[:, 1] >= 0) & (start[:, 1] < rows)
        column, row = start[there].T + margin
        layer.fill(0)
        layer.reshape(-1)[(row * layer.shape[1] + column)[:, np.newaxis] + pixels] = level
        cv2.add(light, inside, dst=light)
    return light


def flake_light(places: np.ndarray, flakes: np.ndarray, columns: int, first: int, end: int) -> np.ndarray:
    """Summed grey levels (uint16) of flakes that begin in rows `first` to `end` - 1, of `columns` columns.

    `places` (layers, n) are row-major pixel numbers; `flakes` (layers, size, size), uint16, are the layers'
    flakes. A flake at a row's end continues in the next row. The result has `size` + 1 additional rows at the
    bottom.
    """
    layer, number = ((places >= first * columns) & (places < end * columns)).nonzero()
    size = flakes.shape[1]
    pixels = (columns * np.arange(size)[:, np.newaxis] + np.arange(size)).ravel()
    light = np.zeros((end - first + size + 1, columns), np.uint16)
    begins = places[layer, number, np.newaxis] - first * columns
    np.add.at(light.reshape(-1), (begins + pixels).ravel(), flakes[layer].ravel())
    return light


def droplets(random: np.random.Generator, shape: tuple[int, int], count: int) -> np.ndarray:
    """A black picture with white pixels in `count` random places. These must be the last numbers drawn from
    `random`."""
    picture = np.zeros(shape, np.uint8)
    picture.reshape(-1)[random.integers(0, picture.size, count)] = WHITE
    return picture


def reach(streak: Streak) -> int:
    return int(np.abs(streak.pixels).max()) + 1
