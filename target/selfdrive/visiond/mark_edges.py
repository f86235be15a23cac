"""Edges of lane marks: the horizontal Sobel operator, and the tiles of a picture that have a mark."""

import cv2
import numpy as np

from selfdrive.visiond.hog import WINDOW_STRIDE

STEEPNESS_RATIO = 1.6  # steepness of an edge, relative to the root mean square of its surroundings
MIN_EDGE_STEEPNESS = 40.0  # of the Sobel sum, whose weights add up to 4; anything less is grain


def tiles_with_mark(marked: np.ndarray, need: int) -> np.ndarray:
    """Return the tiles (bool, 16 x 16 pixels each) that at least `need` of the `marked` windows cover."""
    rows, columns = marked.shape
    cover = np.zeros((rows + 1, columns + 1), np.uint8)
    for down in (0, 1):
        for right in (0, 1):
            cover[down : down + rows, right : right + columns] += marked
    return cover >= need


def windows_on_tiles(tiles: np.ndarray) -> np.ndarray:
    """Return the windows (rows x columns, bool) that cover any of these tiles (bool)."""
    down = tiles[:-1] | tiles[1:]
    return down[:, :-1] | down[:, 1:]


def tile_numbers(rows: int, width: int) -> np.ndarray:
    row, column = np.ogrid[:rows, :width]
    return (
        (row // WINDOW_STRIDE * (width // WINDOW_STRIDE) + column // WINDOW_STRIDE).astype(np.uint16).ravel()
    )


def find_steep_edges(part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find steep edges in `part` (uint8, sides are multiples of a tile's).

    Steepness is relative to the root mean square of nearby tiles, so light and haze do not matter. Returns
    row-major pixel positions, and whether the picture gets brighter to the right of each.
    """
    rows, width = part.shape
    gradient = cv2.Sobel(part, cv2.CV_32F, 1, 0, ksize=3)
    power = cv2.multiply(gradient, gradient)
    tiles = width // WINDOW_STRIDE, rows // WINDOW_STRIDE
    limit = np.repeat(
        steepness_limits(cv2.resize(power, tiles, interpolation=cv2.INTER_AREA)), WINDOW_STRIDE, axis=1
    )
    steep = power.reshape(-1, WINDOW_STRIDE, width) > limit[:, np.newaxis]
    at = steep.ravel().nonzero()[0]
    return at, gradient.take(at) > 0.0


def steepness_limits(power: np.ndarray) -> np.ndarray:
    """Each tile's squared gradient above which edges are steep; `power` has the tiles' means."""
    return np.maximum(STEEPNESS_RATIO**2 * cv2.blur(power, (3, 3)), MIN_EDGE_STEEPNESS**2)
