"""Edges of lane marks: the Sobel operator across the picture, inside the windows in which a mark was seen."""

import cv2
import numpy as np

from selfdrive.visiond.hog import STRIDE, WINDOW

RATIO = 1.6  # how much steeper than its surroundings' root mean square an edge is
FLOOR = 40.0  # of the Sobel sum, whose weights come to 4: less is grain, however even the surroundings


def tiles_with_mark(marked: np.ndarray, need: int) -> np.ndarray:
    """16 x 16 pixel tiles (uint8, 0 or 1) that at least `need` of the marked windows cover.

    `marked` (bool) has the windows' rows and columns; a tile inside the picture's part lies in four of them.
    """
    rows, columns = marked.shape
    cover = np.zeros((rows + 1, columns + 1), np.uint8)
    for down in (0, 1):
        for right in (0, 1):
            cover[down : down + rows, right : right + columns] += marked
    return (cover >= need).view(np.uint8)


def edges(part: np.ndarray, tiles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mask (uint8, 0 or 1) of steep edges in `part` (uint8) within `tiles`, and which of them get brighter.

    Steep is relative to the surroundings, of a window's size, so light and haze do not matter. The second
    has one bool for each set pixel of the mask, in row-major order: to its right the picture is brighter.
    """
    gradient = cv2.Sobel(part, cv2.CV_32F, 1, 0, ksize=3)
    power = cv2.multiply(gradient, gradient)
    limit = cv2.blur(power, (WINDOW, WINDOW))
    steep = power > np.maximum(RATIO**2 * limit, FLOOR**2)
    inside = cv2.resize(
        tiles, (tiles.shape[1] * STRIDE, tiles.shape[0] * STRIDE), interpolation=cv2.INTER_NEAREST
    )
    mask = cv2.bitwise_and(steep.view(np.uint8), inside)
    return mask, gradient.take(np.flatnonzero(mask)) > 0.0
