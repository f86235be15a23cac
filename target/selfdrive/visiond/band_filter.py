"""Finds bright bands, as wide as lane marks, in the map of the road."""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

# columns: width of a mark (up to 0.2 m), and distance from its middle to that of each side
SINGLE_MARK_COLUMNS = (3, 5)
DOUBLE_MARK_COLUMNS = (9, 8)  # the same for a double line, 0.3 m wide in total
SKIPPED_BORDER_COLUMNS = DOUBLE_MARK_COLUMNS[1]  # nearer to the border, a double line has no road beside it
SIDE_COLUMNS = 5  # columns of road on each side for comparison
AVERAGED_ROWS = 3  # rows averaged
SPECK_KERNEL = np.ones((5, 1), np.uint8)  # anything bright in fewer rows is a flake or a drop
TEXTURE_WINDOW = (51, 9)  # columns and rows of the area in which texture is measured
# grey levels added to the road's brightness, so that noise in the dark has little contrast
DARKNESS_OFFSET = 12.0
MIN_MARK_CONTRAST = 0.006  # lowest contrast of a mark, on the cleanest road
# response in units of the texture, at which certainty is 0 and 1
UNCERTAIN_RESPONSE, CERTAIN_RESPONSE = 1.6, 5.0
CERTAINTY_PER_RESPONSE = 1.0 / (CERTAIN_RESPONSE - UNCERTAIN_RESPONSE)
MOST_POINTS = 1500  # number of points kept
CREST_KERNEL = np.ones((1, 5), np.uint8)


class MarkPoints(NamedTuple):
    """Possible marks: row and column in the map, and certainty (0..1)."""

    row: np.ndarray
    column: np.ndarray
    weight: np.ndarray


CrestFinder = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def find_crests(road: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (row-major, without the edge columns) and weights of the crests of bright bands."""
    road = cv2.morphologyEx(road, cv2.MORPH_OPEN, SPECK_KERNEL)
    side, single, double = (
        _box_mean(road, columns) for columns in (SIDE_COLUMNS, SINGLE_MARK_COLUMNS[0], DOUBLE_MARK_COLUMNS[0])
    )
    single = _without_border_columns(single)
    sides = _left_and_right(side, SINGLE_MARK_COLUMNS[1])
    # Results overwrite old arrays, because allocating memory is as slow as the sums.
    contrast = np.maximum(*sides)
    np.subtract(single, contrast, out=contrast)
    other = np.maximum(*_left_and_right(side, DOUBLE_MARK_COLUMNS[1]))
    np.subtract(_without_border_columns(double), other, out=other)
    np.maximum(contrast, other, out=contrast)
    ground = np.add(*sides)
    ground *= np.float32(0.5)
    light = np.add(ground, np.float32(DARKNESS_OFFSET), out=other)
    contrast /= light
    rough = np.subtract(single, ground, out=ground)
    np.abs(rough, out=rough)
    rough /= light
    texture = cv2.blur(rough, TEXTURE_WINDOW, dst=light)
    texture += np.float32(MIN_MARK_CONTRAST)
    sure = np.divide(contrast, texture, out=texture)
    sure -= np.float32(UNCERTAIN_RESPONSE)
    sure *= np.float32(CERTAINTY_PER_RESPONSE)
    # A crest is the highest of five columns around it.
    crest = (sure > 0.0) & (contrast >= cv2.dilate(contrast, CREST_KERNEL))
    at = np.flatnonzero(crest)  # np.nonzero in two dimensions takes four times as long
    return at, np.minimum(sure.ravel()[at], 1.0)


def find_mark_points(road: np.ndarray, find: CrestFinder = find_crests) -> MarkPoints:
    return mark_points_at(*strongest_points(*find(road)), road)


def strongest_points(at: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if len(at) > MOST_POINTS:
        keep = np.sort(np.argsort(weight, kind="stable")[-MOST_POINTS:])
        return at[keep], weight[keep]
    return at, weight


def mark_points_at(at: np.ndarray, weight: np.ndarray, road: np.ndarray) -> MarkPoints:
    row, column = np.divmod(at, road.shape[1] - 2 * SKIPPED_BORDER_COLUMNS)
    return MarkPoints(row, column + SKIPPED_BORDER_COLUMNS, weight)


def _box_mean(road: np.ndarray, columns: int) -> np.ndarray:
    return cv2.boxFilter(road, cv2.CV_32F, (columns, AVERAGED_ROWS))


def _without_border_columns(picture: np.ndarray) -> np.ndarray:
    return picture[:, SKIPPED_BORDER_COLUMNS:-SKIPPED_BORDER_COLUMNS]


def _left_and_right(side: np.ndarray, apart: int) -> tuple[np.ndarray, np.ndarray]:
    end = side.shape[1]
    return side[:, SKIPPED_BORDER_COLUMNS - apart : end - SKIPPED_BORDER_COLUMNS - apart], side[
        :, SKIPPED_BORDER_COLUMNS + apart : end - SKIPPED_BORDER_COLUMNS + apart
    ]
