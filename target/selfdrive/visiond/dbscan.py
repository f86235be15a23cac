"""DBSCAN (M. Ester and others, 1996) on the pixels of a mask, exact and fast.

The distance is the larger of rows and columns (Chebyshev), so a box filter counts neighbours. Two core pixels
are neighbours if and only if their eps x eps squares touch or overlap, so clusters are the connected
components of a mask of such squares.
"""

import cv2
import numpy as np

NOISE = -1  # as in scikit-learn

_NO_CLUSTER = 65535  # larger than any cluster, so that the minimum over neighbours ignores it


def dbscan(points: np.ndarray, shape: tuple[int, int], eps: int, min_samples: int) -> np.ndarray:
    """Return the cluster (0, 1, ...) of each pixel, or NOISE for outliers.

    `points` are row-major positions in a picture of that shape, ascending. A core pixel has at least
    `min_samples` of them, itself included, within `eps` pixels. Clusters are numbered, and pixels between
    clusters assigned, as in scikit-learn.
    """
    mask = _mask_of_points(points, shape)
    square = np.ones((2 * eps + 1, 2 * eps + 1), np.uint8)
    crowd = cv2.boxFilter(mask, cv2.CV_16U, square.shape, normalize=False, borderType=cv2.BORDER_CONSTANT)
    is_core = crowd.take(points) >= min_samples
    all_core = bool(is_core.all())
    cores = points if all_core else points[is_core]
    core = mask if all_core else _mask_of_points(cores, shape)
    squares = cv2.dilate(core, np.ones((eps, eps), np.uint8), anchor=(0, 0))
    count, labels = cv2.connectedComponents(squares, connectivity=8, ltype=cv2.CV_16U)
    labels = labels.take(cores)
    clusters = _rank_components(labels, count).take(labels)
    if all_core:
        return clusters.astype(np.intp)
    numbered = np.full(shape, _NO_CLUSTER, np.uint16)
    numbered.ravel()[cores] = clusters
    around = cv2.erode(numbered, square).take(points)  # the first cluster with a core pixel in range
    around[is_core] = clusters
    clusters = around.astype(np.intp)
    clusters[clusters == _NO_CLUSTER] = NOISE
    return clusters


def _mask_of_points(points: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    mask = np.zeros(shape, np.uint8)
    mask.ravel()[points] = 1
    return mask


def _rank_components(labels: np.ndarray, count: int) -> np.ndarray:
    """Rank `count` components (uint16) by their first core pixel; `labels` are those of the core pixels."""
    first = np.empty(count, np.intp)
    first[labels[::-1]] = np.arange(labels.size)[::-1]  # the last assignment wins
    order = np.empty(count, np.uint16)
    order[0] = _NO_CLUSTER  # the background
    order[1 + np.argsort(first[1:], kind="stable")] = np.arange(count - 1, dtype=np.uint16)
    return order
