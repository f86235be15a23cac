"""Warps a region of a picture to the same bytes as OpenCV warps the whole picture."""

import cv2
import numpy as np

from selfdrive.sim.picture import Region

VECTOR_COLUMNS = 64  # columns; a vector of this length in OpenCV, whatever the row's length


def warp(source: np.ndarray, matrix: np.ndarray, region: Region) -> np.ndarray:
    """Return a region of the warped picture, which is as large as `source` (uint8).

    A place in it shows `source` at `matrix` (3 x 3) times that place; outside `source`, its last pixels are
    repeated. To get the same bits as for the whole, rows start at column 0 and have whole vectors of columns.
    """
    columns = min(-(-region.right // VECTOR_COLUMNS) * VECTOR_COLUMNS, source.shape[1])
    warped = cv2.warpPerspective(
        source,
        matrix,
        (columns, region.bottom),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return warped[region.part]
