"""The camera of a run with pictures: the library's frame, as it would look from where the car is.

A frame was taken in the lane's middle, along the road. Seen from `offset` m further left and turned by
`heading`, the ground moves by a homography that follows from the camera's geometry: exact for all that lies
on the road. What is above the horizon only pans. Where the frame ends, its last pixel is repeated.
"""

from math import tan

import cv2
import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.messages import CameraView
from selfdrive.sim.camera import Camera
from selfdrive.sim.image_library import ImageLibrary
from selfdrive.sim.road_renderer import car_to_road, first_road_row, pan, picture_to_car
from selfdrive.sim.truth import GroundTruth
from selfdrive.sim.vision import GROUND

# Poses are rounded to these, less than a detector can tell: equal poses give equal bytes.
OFFSET_STEP = 0.004  # m
HEADING_STEP = 0.00025  # rad
SHIFT_DISTANCE = 10.0  # m ahead where a shift of the whole frame is right


class PictureCamera:
    """Takes the view's geometry from `geometry` and its picture from `library`.

    `translation` is "ground", as above, or "shift": the frame moves sideways as a whole, as far as the lane
    has moved SHIFT_DISTANCE ahead.
    """

    def __init__(self, geometry: Camera, library: ImageLibrary, translation: str) -> None:
        self._geometry, self._library = geometry, library
        self.model = library.model
        self._move = GroundView(self.model) if translation == GROUND else ShiftedView(self.model)

    def look(self, truth: GroundTruth) -> CameraView:
        """The view at this moment. Its picture must not be written to."""
        view = self._geometry.look(truth)
        frame = self._library.frame(truth.t, truth.position)
        picture = self._move.seen(frame, truth.lateral_offset, truth.heading)
        return view._replace(picture=picture)


class GroundView:
    """Moves frames to another place on the road by the ground's homography."""

    def __init__(self, model: CameraModel) -> None:
        self._model = model
        self._first = first_road_row(model)
        self._to_car = picture_to_car(model, self._first)
        self._from_car = np.linalg.inv(self._to_car)

    def seen(self, frame: np.ndarray, offset: float, heading: float) -> np.ndarray:
        """The frame (rows x width) as seen `offset` m further left (m), turned left by `heading` (rad)."""
        offset, heading = rounded(offset, OFFSET_STEP), rounded(heading, HEADING_STEP)
        if offset == 0.0 and heading == 0.0:
            return frame
        first, (rows, width) = self._first, frame.shape
        picture = np.empty_like(frame)
        moved(frame[:first], pan(self._model, heading), picture[:first])
        cv2.warpPerspective(
            frame[first:],
            self._from_car @ car_to_road(0.0, offset, heading) @ self._to_car,
            (width, rows - first),
            dst=picture[first:],
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return picture


class ShiftedView:
    """Moves frames sideways as a whole: how the paper makes the view follow the car."""

    def __init__(self, model: CameraModel) -> None:
        self._pixels_per_metre = 1.0 / model.metres_per_pixel(model.row(SHIFT_DISTANCE))

    def seen(self, frame: np.ndarray, offset: float, heading: float) -> np.ndarray:
        """The frame (rows x width) as seen `offset` m further left (m), turned left by `heading` (rad)."""
        away = offset + SHIFT_DISTANCE * tan(heading)
        picture = np.empty_like(frame)
        moved(frame, round(away * self._pixels_per_metre), picture)
        return picture


def moved(frame: np.ndarray, columns: int, out: np.ndarray) -> None:
    """Write `frame` to `out`, moved that far to the right; where it ends, its last column is repeated."""
    width = frame.shape[1]
    left = min(max(columns, 0), width)
    right = min(max(width + columns, 0), width)
    out[:, left:right] = frame[:, left - columns : right - columns]
    out[:, :left] = frame[:, :1]
    out[:, right:] = frame[:, -1:]


def rounded(value: float, step: float) -> float:
    """The nearest multiple of `step`."""
    return step * round(value / step)
