"""How the camera's frame looks from elsewhere on the road.

A frame was taken in the lane's middle, along the road. Seen from `offset` m further left and turned by
`heading`, the ground moves by a homography that follows from the camera's geometry: exact for all that lies
on the road. What is above the horizon only pans. Where the frame ends, its last pixel is repeated.
"""

from math import tan

import cv2
import numpy as np

from selfdrive.common.array_math import dot, product
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.picture import Picture
from selfdrive.sim.road_renderer import car_to_road, first_road_row, pan, picture_to_car

# Poses are rounded to these, less than a detector can tell: equal poses give equal bytes.
OFFSET_STEP = 0.004  # m
HEADING_STEP = 0.00025  # rad
SHIFT_DISTANCE = 10.0  # m ahead where a shift of the whole frame is right
CODED_METRES_PER_PIXEL = 0.03895
CODED_REACH = 1.0  # m: further the picture never moves
VECTOR = 64  # columns: of so many OpenCV calculates a row's pixels alike, however long the row is


class GroundView:
    """Moves frames to another place on the road by the ground's homography."""

    def __init__(self, model: CameraModel) -> None:
        self._model = model
        self._first = first_road_row(model)
        self._to_car = picture_to_car(model, self._first)
        self._from_car = _inverse(self._to_car)

    def seen(self, frame: Picture, offset: float, heading: float) -> Picture:
        """The frame as seen `offset` m further left (m), turned left by `heading` (rad)."""
        left, turn = round(offset / OFFSET_STEP), round(heading / HEADING_STEP)
        if left == 0 and turn == 0:
            return frame
        return frame.changed(
            ("ground", left, turn),
            lambda rows, columns: self._moved(
                frame.pixels(), OFFSET_STEP * left, HEADING_STEP * turn, rows, columns
            ),
        )

    def _moved(self, frame: np.ndarray, offset: float, heading: float, rows: int, columns: int) -> np.ndarray:
        """So many of the moved frame's first rows; below the horizon, columns that are not asked for may be
        missing.
        """
        first, width = self._first, frame.shape[1]
        picture = np.empty((rows, width), np.uint8)
        moved(frame[:first], pan(self._model, heading), picture[:first])
        if rows > first:
            columns = min(-(-columns // VECTOR) * VECTOR, width)
            cv2.warpPerspective(
                frame[first:],
                product(product(self._from_car, car_to_road(0.0, offset, heading)), self._to_car),
                (columns, rows - first),
                dst=picture[first:, :columns],
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )
        return picture


class ShiftedView:
    """Moves frames sideways as a whole: how the paper makes the view follow the car."""

    def __init__(self, model: CameraModel) -> None:
        self._pixels_per_metre = 1.0 / model.metres_per_pixel(model.row(SHIFT_DISTANCE))

    def seen(self, frame: Picture, offset: float, heading: float) -> Picture:
        """The frame as seen `offset` m further left (m), turned left by `heading` (rad)."""
        away = offset + SHIFT_DISTANCE * tan(heading)
        return _shifted(frame, round(away * self._pixels_per_metre))


class CodedView:
    """Moves frames sideways as a whole, as the paper's authors coded it: by the metres of another row than
    the one in which their detector reads lines, so that it sees 64 % of the way. Heading is not seen."""

    def seen(self, frame: Picture, offset: float, heading: float) -> Picture:
        """The frame as seen `offset` m further left (m); `heading` is of no account."""
        return _shifted(frame, round(min(max(offset, -CODED_REACH), CODED_REACH) / CODED_METRES_PER_PIXEL))


def _shifted(frame: Picture, columns: int) -> Picture:
    """The frame moved that far to the right."""

    def make(rows: int, width: int) -> np.ndarray:
        picture = np.empty((rows, frame.shape[1]), np.uint8)
        moved(frame.pixels()[:rows], columns, picture)
        return picture

    return frame.changed(("shift", columns), make)


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Of a matrix of three rows."""
    a, b, c = matrix
    columns = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    return np.array(columns).T / dot(a, columns[0])


def moved(frame: np.ndarray, columns: int, out: np.ndarray) -> None:
    """Write `frame` to `out`, which may have fewer rows, moved that far to the right.

    Where it ends, its last column is repeated.
    """
    frame = frame[: len(out)]
    width = frame.shape[1]
    left = min(max(columns, 0), width)
    right = min(max(width + columns, 0), width)
    out[:, left:right] = frame[:, left - columns : right - columns]
    out[:, :left] = frame[:, :1]
    out[:, right:] = frame[:, -1:]
