"""Finds bright bands, as wide as lane marks, in the map of the road."""

from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np

SINGLE = (3, 5)  # columns: width of a mark (up to 0.2 m), and distance from its middle to that of each side
DOUBLE = (9, 8)  # the same for a double line, 0.3 m wide in total
EDGE = DOUBLE[1]
SIDE = 5  # columns of road on each side for comparison
ALONG = 3  # rows averaged
SPECK = np.ones((5, 1), np.uint8)  # anything bright in fewer rows is a flake or a drop
NEIGHBOURHOOD = (51, 9)  # columns and rows of the area in which texture is measured
DARK = 12.0  # grey levels added to the road's brightness, so that noise in the dark has little contrast
LEAST = 0.006  # lowest contrast of a mark, on the cleanest road
QUIET, CLEAR = 1.6, 5.0  # response in units of the texture, at which certainty is 0 and 1
STEEPNESS = 1.0 / (CLEAR - QUIET)
STRONGEST = 1500  # number of points kept
ACROSS = np.ones((1, 5), np.uint8)


class Points(NamedTuple):
    """Possible marks: row and column in the map, and certainty (0..1)."""

    row: np.ndarray
    column: np.ndarray
    weight: np.ndarray


Crests = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def crests(road: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (row-major, without the edge columns) and weights of the crests of bright bands."""
    road = cv2.morphologyEx(road, cv2.MORPH_OPEN, SPECK)
    side, single, double = (_mean(road, columns) for columns in (SIDE, SINGLE[0], DOUBLE[0]))
    single = _inner(single)
    sides = _sides(side, SINGLE[1])
    # Results overwrite old arrays, because allocating memory is as slow as the sums.
    contrast = np.maximum(*sides)
    np.subtract(single, contrast, out=contrast)
    other = np.maximum(*_sides(side, DOUBLE[1]))
    np.subtract(_inner(double), other, out=other)
    np.maximum(contrast, other, out=contrast)
    ground = np.add(*sides)
    ground *= np.float32(0.5)
    light = np.add(ground, np.float32(DARK), out=other)
    contrast /= light
    rough = np.subtract(single, ground, out=ground)
    np.abs(rough, out=rough)
    rough /= light
    texture = cv2.blur(rough, NEIGHBOURHOOD, dst=light)
    texture += np.float32(LEAST)
    sure = np.divide(contrast, texture, out=texture)
    sure -= np.float32(QUIET)
    sure *= np.float32(STEEPNESS)
    # A crest is the highest of five columns around it.
    crest = (sure > 0.0) & (contrast >= cv2.dilate(contrast, ACROSS))
    at = np.flatnonzero(crest)  # np.nonzero in two dimensions takes four times as long
    return at, np.minimum(sure.ravel()[at], 1.0)


def mark_points(road: np.ndarray, find: Crests = crests) -> Points:
    return points_at(*strongest(*find(road)), road)


def strongest(at: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    if len(at) > STRONGEST:
        keep = np.sort(np.argsort(weight, kind="stable")[-STRONGEST:])
        return at[keep], weight[keep]
    return at, weight


def points_at(at: np.ndarray, weight: np.ndarray, road: np.ndarray) -> Points:
    row, column = np.divmod(at, road.shape[1] - 2 * EDGE)
    return Points(row, column + EDGE, weight)


def _mean(road: np.ndarray, columns: int) -> np.ndarray:
    return cv2.boxFilter(road, cv2.CV_32F, (columns, ALONG))


def _inner(picture: np.ndarray) -> np.ndarray:
    return picture[:, EDGE:-EDGE]


def _sides(side: np.ndarray, apart: int) -> tuple[np.ndarray, np.ndarray]:
    end = side.shape[1]
    return side[:, EDGE - apart : end - EDGE - apart], side[:, EDGE + apart : end - EDGE + apart]
