"""Where the map of the road is brighter, in a band as wide as a mark, than on both sides of it."""

from typing import NamedTuple

import cv2
import numpy as np

SINGLE = (3, 5)  # columns: of a mark, and from its middle to that of each side, so it may be 0.2 m wide
DOUBLE = (9, 8)  # the same for two lines with a gap between, 0.3 m wide together
SIDE = 5  # columns of road compared with, on each side
ALONG = 3  # rows averaged
NEIGHBOURHOOD = (51, 9)  # columns and rows in which texture is measured
DARK = 12.0  # grey levels added to the road's brightness, so that noise in the dark is no contrast
LEAST = 0.015  # contrast below which nothing is a mark, on the cleanest road
QUIET, CLEAR = 1.6, 5.0  # response in units of the texture: below the first nothing, from the second on all
STRONGEST = 1500  # points kept


class Points(NamedTuple):
    """Where marks may be: row and column in the map, and how sure (0..1)."""

    row: np.ndarray
    column: np.ndarray
    weight: np.ndarray


def mark_points(road: np.ndarray) -> Points:
    """The crests of bright bands in `road`, a map (float32 or uint8, rows x columns) of the road."""
    road = cv2.blur(road.astype(np.float32), (1, ALONG))
    side = cv2.blur(road, (SIDE, 1))
    single, ground = _band(road, side, *SINGLE)
    double, _ = _band(road, side, *DOUBLE)
    light = ground + DARK
    contrast = np.maximum(single, double) / light
    texture = cv2.blur(np.abs(cv2.blur(road, (SINGLE[0], 1)) - ground) / light, NEIGHBOURHOOD)
    sure = (contrast / (texture + LEAST) - QUIET) * np.float32(1.0 / (CLEAR - QUIET))
    np.clip(sure, 0.0, 1.0, out=sure)
    return _crests(sure, contrast)


def _band(road: np.ndarray, side: np.ndarray, width: int, apart: int) -> tuple[np.ndarray, np.ndarray]:
    """How much brighter a band is than the brighter one of its sides, and the mean of these."""
    left, right = _moved(side, apart), _moved(side, -apart)
    return cv2.blur(road, (width, 1)) - np.maximum(left, right), 0.5 * (left + right)


def _moved(picture: np.ndarray, columns: int) -> np.ndarray:
    """`picture` moved to the right, its edge columns repeated."""
    moved = np.empty_like(picture)
    if columns > 0:
        moved[:, columns:] = picture[:, :-columns]
        moved[:, :columns] = picture[:, :1]
    else:
        moved[:, :columns] = picture[:, -columns:]
        moved[:, columns:] = picture[:, -1:]
    return moved


def _crests(sure: np.ndarray, contrast: np.ndarray) -> Points:
    """The points in which contrast is the highest of the five columns around."""
    crest = (sure > 0.0) & (contrast >= cv2.dilate(contrast, np.ones((1, 5), np.uint8)))
    row, column = np.nonzero(crest)
    weight = sure[row, column]
    if len(weight) > STRONGEST:
        keep = np.sort(np.argpartition(weight, -STRONGEST)[-STRONGEST:])
        row, column, weight = row[keep], column[keep], weight[keep]
    return Points(row, column, weight)
