"""A camera, moments of a drive, and a plain road as input for effects."""

from typing import NamedTuple

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel


class Moment(NamedTuple):
    t: float
    position: float
    v_ego: float


@pytest.fixture(scope="session")
def camera():
    return CameraModel()


@pytest.fixture(scope="session")
def moment():
    def make(number=0, speed=26.8):
        return Moment(1.5 + 0.05 * number, 40.0 + 0.05 * number * speed, speed)

    return make


@pytest.fixture(scope="session")
def road(camera):
    """Grey asphalt with two white marks under a bright sky, read-only like frames of a library."""
    picture = np.full((camera.rows, camera.width), 95, dtype=np.uint8)
    horizon = round(camera.horizon)
    picture[:horizon] = 205
    for y in (1.85, -1.85):
        a, b = camera.line_in_picture(y, 0.0)
        for row in range(horizon + 5, camera.rows):
            half = 0.06 / camera.metres_per_pixel(row)
            left, right = round(a * row + b - half), round(a * row + b + half) + 1
            picture[row, max(left, 0) : max(right, 0)] = 215
    picture.setflags(write=False)
    return picture
