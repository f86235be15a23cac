"""DBSCAN (M. Ester and others, 1996) on the pixels of a mask, exact and quick.

The distance is the larger of the two between rows and columns (Chebyshev). A pixel's neighbours then are
those of a square, so a box filter counts them. Two core pixels are neighbours exactly if the eps x eps
squares that begin at each touch or overlap: clusters are the connected components of a mask of such squares.
"""

import cv2
import numpy as np

NOISE = -1

_NONE = 65535


def dbscan(mask: np.ndarray, eps: int, min_samples: int) -> np.ndarray:
    """Cluster (0, 1, ...) of each set pixel of `mask` (uint8, 0 or 1) in row-major order, NOISE for outliers.

    A core pixel has at least `min_samples` set ones, itself included, no further than `eps` pixels away.
    Clusters are numbered, and pixels at the edge of several given to one, as scikit-learn does.
    """
    square = np.ones((2 * eps + 1, 2 * eps + 1), np.uint8)
    crowd = cv2.boxFilter(mask, cv2.CV_16U, square.shape, normalize=False, borderType=cv2.BORDER_CONSTANT)
    core = cv2.bitwise_and(mask, (crowd >= min_samples).view(np.uint8))
    points = np.flatnonzero(mask.view(bool))
    is_core = core.take(points).view(bool)
    squares = cv2.dilate(core, np.ones((eps, eps), np.uint8), anchor=(0, 0))
    count, labels = cv2.connectedComponents(squares, connectivity=8, ltype=cv2.CV_16U)
    order = _order(labels.take(points[is_core]), count)
    found = order.take(labels.take(points))
    if not is_core.all():
        numbered = np.full_like(labels, _NONE)
        cv2.copyTo(order.take(labels), core, numbered)
        reached = cv2.erode(numbered, square)  # the first cluster with a core pixel near enough
        found = np.where(is_core, found, reached.take(points))
    found = found.astype(np.intp)
    found[found == _NONE] = NOISE
    return found


def _order(labels: np.ndarray, count: int) -> np.ndarray:
    """Number of each of `count` components by the first of the core pixels with these labels; uint16."""
    first = np.empty(count, np.intp)
    first[labels[::-1]] = np.arange(labels.size)[::-1]  # of equal ones the last assignment counts
    order = np.empty(count, np.uint16)
    order[0] = _NONE  # the background
    order[1 + np.argsort(first[1:])] = np.arange(count - 1, dtype=np.uint16)
    return order
