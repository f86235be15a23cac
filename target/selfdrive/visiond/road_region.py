"""The part of the picture in which the paper's detector searches for lane marks, and its windows.

It is the road from `NEAR` to `FAR` metres ahead and `SIDE` metres to each side (wider further ahead, because
the car can point off the road).
"""

from math import ceil, floor

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.visiond.hog import STRIDE, WINDOW

NEAR, FAR = 4.9, 30.0  # m ahead; the nearest row is always examined, the furthest can be left out
SIDE = 3.8  # m; where a lane's line is when the car is almost in the next lane
TURN = 0.08  # m wider per metre ahead


class RoadRegion:
    """Rows and columns of the picture (`part`), and which of its windows show enough of the road.

    Raises ConfigError if the camera sees too little of the road for one window.
    """

    def __init__(self, model: CameraModel) -> None:
        last = min(model.rows, floor(model.row(NEAR)))
        rows = (last - max(0, ceil(model.row(FAR)))) // STRIDE * STRIDE
        if rows < WINDOW:
            raise ConfigError(
                f"{max(rows, 0)} rows of road between {NEAR} and {FAR} m",
                where="the camera's calibration",
                expected=f"at least {WINDOW}",
                remedy="use larger pictures, or a camera that sees the road before the car",
            )
        self.first_row = last - rows
        reach = _reach(model, last - 1)
        first = max(0, floor(model.cx - reach))
        width = (min(model.width, ceil(model.cx + reach)) - first) // STRIDE * STRIDE
        self.first_column = first
        self.part = slice(self.first_row, last), slice(first, first + width)
        self.shape = rows, width
        self.windows = self._seeing_road(model)

    def _seeing_road(self, model: CameraModel) -> np.ndarray:
        down, across = ((size - WINDOW) // STRIDE + 1 for size in self.shape)
        left = self.first_column + STRIDE * np.arange(across) - model.cx
        reach = np.array([_reach(model, self.first_row + STRIDE * row + WINDOW - 1) for row in range(down)])
        return (left + WINDOW > -reach[:, np.newaxis]) & (left < reach[:, np.newaxis])


def _reach(model: CameraModel, row: float) -> float:
    """Pixels from the picture's middle to the region's edge in `row`."""
    return (SIDE + TURN * model.distance(row)) / model.metres_per_pixel(row)
