"""The camera's frame as seen from a different place on the road.

Frames are taken in the lane centre, along the road. Seen from `offset` m further left and turned by
`heading`, the ground is transformed by a homography, which is exact for everything on the road. Parts above
the horizon only move sideways. Outside the frame, its last pixel is repeated.
"""

from math import tan

import numpy as np

from selfdrive.common.array_math import dot, product
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.compiled_warp import build_warp
from selfdrive.sim.picture import Picture, Region
from selfdrive.sim.road_renderer import car_to_road, first_road_row, pan_pixels, picture_to_car

# Steps to which poses are rounded, below a detector's resolution: equal poses give equal bytes.
OFFSET_STEP = 0.004  # m
HEADING_STEP = 0.00025  # rad
SHIFT_DISTANCE = 10.0  # m ahead, where shifting the whole frame is exact
AUTHORS_METRES_PER_PIXEL = 0.03895  # from the code of the paper's authors
MOST_AUTHORS_CODE_SHIFT = 1.0  # m; largest shift of the picture


class HomographyMover:
    """Moves frames to another place on the road by the ground's homography.

    `calculated_by` identifies the compiled code in use, if any.
    """

    def __init__(self, model: CameraModel) -> None:
        self._model = model
        self._first = first_road_row(model)
        self._to_car = picture_to_car(model, self._first)
        self._from_car = _inverse_matrix(self._to_car)
        self._warp, self.calculated_by = build_warp()

    def seen(self, frame: Picture, offset: float, heading: float) -> Picture:
        """Return the frame as seen `offset` m further left, turned left by `heading` (rad)."""
        offset_steps, heading_steps = round(offset / OFFSET_STEP), round(heading / HEADING_STEP)
        if offset_steps == 0 and heading_steps == 0:
            return frame
        offset, heading = OFFSET_STEP * offset_steps, HEADING_STEP * heading_steps
        return frame.changed(
            ("ground", offset_steps, heading_steps),
            lambda region: self._move_region(frame, offset, heading, region),
        )

    def _move_region(self, frame: Picture, offset: float, heading: float, region: Region) -> np.ndarray:
        first = self._first
        parts = []
        if region.top < first:
            above = region._replace(bottom=min(region.bottom, first))
            parts.append(shift_region(frame, pan_pixels(self._model, heading), above))
        if region.bottom > first:
            matrix = product(product(self._from_car, car_to_road(0.0, offset, heading)), self._to_car)
            below = region._replace(top=max(region.top - first, 0), bottom=region.bottom - first)
            parts.append(self._warp(frame.pixels()[first:], matrix, below))
        return parts[0] if len(parts) == 1 else np.concatenate(parts)


class ShiftMover:
    """Moves whole frames sideways, as the paper does to follow the car."""

    calculated_by = ""  # no compiled code

    def __init__(self, model: CameraModel) -> None:
        self._pixels_per_metre = 1.0 / model.metres_per_pixel(model.row(SHIFT_DISTANCE))

    def seen(self, frame: Picture, offset: float, heading: float) -> Picture:
        away = offset + SHIFT_DISTANCE * tan(heading)
        return _shift_frame(frame, round(away * self._pixels_per_metre))


class AuthorsCodeShiftMover:
    """Moves whole frames sideways as the paper's authors coded it: the scale is that of a different row than
    the one where their detector reads lines, so the detector sees 64 % of the offset."""

    calculated_by = ""

    def seen(self, frame: Picture, offset: float, heading: float) -> Picture:
        return _shift_frame(
            frame,
            round(
                min(max(offset, -MOST_AUTHORS_CODE_SHIFT), MOST_AUTHORS_CODE_SHIFT) / AUTHORS_METRES_PER_PIXEL
            ),
        )


def _shift_frame(frame: Picture, columns: int) -> Picture:
    return frame.changed(("shift", columns), lambda region: shift_region(frame, columns, region))


def _inverse_matrix(matrix: np.ndarray) -> np.ndarray:
    a, b, c = matrix
    columns = np.cross(b, c), np.cross(c, a), np.cross(a, b)
    return np.array(columns).T / dot(a, columns[0])


def shift_region(frame: Picture, columns: int, region: Region) -> np.ndarray:
    """Return the region of `frame` moved to the right; outside the frame, its last column is repeated."""
    last = frame.shape[1] - 1
    left, right = (min(max(end - columns, 0), last) for end in (region.left, region.right - 1))
    source = frame[region.top : region.bottom, left : right + 1]
    before = min(max(left - (region.left - columns), 0), region.shape[1] - 1)
    out = np.empty(region.shape, np.uint8)
    out[:, before : before + right + 1 - left] = source
    out[:, :before] = source[:, :1]
    out[:, before + right + 1 - left :] = source[:, -1:]
    return out
