"""A region of a picture, as OpenCV warps the whole."""

import cv2
import numpy as np

from selfdrive.sim.picture import Region

VECTOR = 64  # columns: of so many OpenCV calculates a row's pixels alike, however long the row is


def warp(source: np.ndarray, matrix: np.ndarray, region: Region) -> np.ndarray:
    """The region of a picture as large as `source` (uint8), which shows at each place what `source` shows
    where `matrix` (3 x 3) leads from there. Beyond its border `source` repeats its last pixels.

    OpenCV gives the bits of the whole where rows are made from the first on, and whole vectors of columns.
    """
    columns = min(-(-region.right // VECTOR) * VECTOR, source.shape[1])
    seen = cv2.warpPerspective(
        source,
        matrix,
        (columns, region.bottom),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return seen[region.part]
