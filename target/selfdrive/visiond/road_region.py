"""The part of the picture in which the paper's detector searches for lane marks, and its windows.

It is the road from `REGION_NEAR` to `REGION_FAR` metres ahead and `REGION_SIDE` metres to each side (wider
further ahead, because the car can point off the road).
"""

from math import ceil, floor

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.visiond.hog import WINDOW_PIXELS, WINDOW_STRIDE

# m ahead; the nearest row is always examined, the furthest can be left out
REGION_NEAR, REGION_FAR = 4.9, 30.0
REGION_SIDE = 3.8  # m; where a lane's line is when the car is almost in the next lane
REGION_WIDENING = 0.08  # m wider per metre ahead


class RoadRegion:
    """Rows and columns of the picture (`part`), and which of its windows show enough of the road.

    Raises ConfigError if the camera sees too little of the road for one window.
    """

    def __init__(self, model: CameraModel) -> None:
        last = min(model.rows, floor(model.row(REGION_NEAR)))
        rows = (last - max(0, ceil(model.row(REGION_FAR)))) // WINDOW_STRIDE * WINDOW_STRIDE
        if rows < WINDOW_PIXELS:
            raise ConfigError(
                f"{max(rows, 0)} rows of road between {REGION_NEAR} and {REGION_FAR} m",
                where="the camera's calibration",
                expected=f"at least {WINDOW_PIXELS}",
                remedy="use larger pictures, or a camera that sees the road before the car",
            )
        self.first_row = last - rows
        reach = _reach_pixels(model, last - 1)
        first = max(0, floor(model.cx - reach))
        width = (min(model.width, ceil(model.cx + reach)) - first) // WINDOW_STRIDE * WINDOW_STRIDE
        self.first_column = first
        self.part = slice(self.first_row, last), slice(first, first + width)
        self.shape = rows, width
        self.windows = self._windows_on_road(model)

    def _windows_on_road(self, model: CameraModel) -> np.ndarray:
        down, across = ((size - WINDOW_PIXELS) // WINDOW_STRIDE + 1 for size in self.shape)
        first_column = self.first_column + WINDOW_STRIDE * np.arange(across) - model.cx
        reach = np.array(
            [
                _reach_pixels(model, self.first_row + WINDOW_STRIDE * row + WINDOW_PIXELS - 1)
                for row in range(down)
            ]
        )
        return (first_column + WINDOW_PIXELS > -reach[:, np.newaxis]) & (first_column < reach[:, np.newaxis])


def _reach_pixels(model: CameraModel, row: float) -> float:
    """Pixels from the picture's middle to the region's edge in `row`."""
    return (REGION_SIDE + REGION_WIDENING * model.distance(row)) / model.metres_per_pixel(row)
