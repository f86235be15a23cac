"""Edges of lane marks: the Sobel operator across the picture, inside the windows in which a mark was seen."""

import cv2
import numpy as np

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

    Steep is relative to the root mean square of the tiles around, so light and haze do not matter. The second
    has one bool for each set pixel of the mask, in row-major order: to its right the picture is brighter.
    """
    gradient = cv2.Sobel(part, cv2.CV_32F, 1, 0, ksize=3)
    power = cv2.multiply(gradient, gradient)
    around = cv2.blur(cv2.resize(power, tiles.shape[::-1], interpolation=cv2.INTER_AREA), (3, 3))
    limit = np.where(tiles, np.maximum(RATIO**2 * around, FLOOR**2), np.inf).astype(np.float32)
    size = part.shape[::-1]
    steep = power > cv2.resize(limit, size, interpolation=cv2.INTER_NEAREST)
    return steep.view(np.uint8), gradient.take(np.flatnonzero(steep)) > 0.0
