"""Where the map of the road is brighter, in a band as wide as a mark, than on both sides of it."""

from typing import NamedTuple

import cv2
import numpy as np

CENTRE = 3  # columns: 0.12 m, a mark
SIDE = 5  # columns of road compared with, on each side
APART = 5  # columns from the middle of the mark to the middle of a side; lets marks be up to 0.2 m wide
ALONG = 3  # rows averaged
NEIGHBOURHOOD = (41, 7)  # columns and rows in which texture is measured
DARK = 12.0  # grey levels added to the road's brightness, so that noise in the dark is no contrast
LEAST = 0.03  # contrast below which nothing is a mark, on the cleanest road
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
    centre = cv2.blur(road, (CENTRE, 1))
    side = cv2.blur(road, (SIDE, 1))
    left, right = _moved(side, APART), _moved(side, -APART)
    ground = 0.5 * (left + right)
    light = ground + DARK
    contrast = (centre - np.maximum(left, right)) / light
    texture = cv2.blur(np.abs(centre - ground) / light, NEIGHBOURHOOD)
    sure = (contrast / (texture + LEAST) - QUIET) * np.float32(1.0 / (CLEAR - QUIET))
    np.clip(sure, 0.0, 1.0, out=sure)
    return _crests(sure, contrast)


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
    crest = (sure > 0.0) & (contrast >= cv2.dilate(contrast, np.ones((1, CENTRE + 2), np.uint8)))
    row, column = np.nonzero(crest)
    weight = sure[row, column]
    if len(weight) > STRONGEST:
        keep = np.sort(np.argpartition(weight, -STRONGEST)[-STRONGEST:])
        row, column, weight = row[keep], column[keep], weight[keep]
    return Points(row, column, weight)
