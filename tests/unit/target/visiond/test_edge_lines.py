"""Edges become lines: which edges are a lane mark, and where the line is on the road."""

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.visiond.dbscan import dbscan
from selfdrive.visiond.edge_lines import EdgeLines
from selfdrive.visiond.mark_edges import find_steep_edges
from selfdrive.visiond.road_region import RoadRegion

MODEL = CameraModel()
REGION = RoadRegion(MODEL)
TONE = 90


def seen(*strips: tuple[float, float, int], slope: float = 0.0):
    """Return the lines found in an image with strips along the road, each (left edge in m, right edge in m,
    grey level)."""
    row = np.arange(MODEL.rows)[:, np.newaxis]
    column = np.arange(MODEL.width)[np.newaxis]
    picture = np.full((MODEL.rows, MODEL.width), TONE, np.uint8)
    for left, right, tone in strips:
        (a, b), (c, d) = (MODEL.line_in_picture(y, slope) for y in (left, right))
        inside = (column >= a * row + b) & (column < c * row + d)
        picture[inside & (row > MODEL.horizon)] = tone
    part = np.ascontiguousarray(picture[REGION.part])
    at, rising = find_steep_edges(part)
    return EdgeLines(MODEL, REGION).nearest_lines(at, rising, dbscan(at, part.shape, 4, 8))


@pytest.mark.parametrize("slope", [-0.05, 0.0, 0.05])
def test_bright_strips_are_lines(slope):
    left, right = seen((1.9, 1.78, 200), (-1.6, -1.72, 200), slope=slope)
    assert (left.y, left.slope) == pytest.approx((1.84, slope), abs=0.02)
    assert (right.y, right.slope) == pytest.approx((-1.66, slope), abs=0.02)


def test_the_nearest_strip_is_the_line():
    left, right = seen((5.6, 5.5, 210), (3.3, 3.2, 210), (1.4, 1.3, 140))
    assert left.y == pytest.approx(1.35, abs=0.03)
    assert right is None


@pytest.mark.parametrize("strip", [(1.0, -9.0, 30), (1.1, 0.98, 30), (9.0, 0.7, 160)])
def test_steps_and_dark_strips_are_not_lines(strip):
    assert seen(strip) == (None, None)


def test_paint_behind_a_step_is_found():
    left, _ = seen((9.0, 0.9, 60), (1.9, 1.78, 160))
    assert left.y == pytest.approx(1.84, abs=0.03)


@pytest.mark.parametrize("width", [0.02, 0.04, 0.08])
@pytest.mark.parametrize("gap", [0.0, 0.03, 0.06])
def test_a_dark_joint_beside_the_paint_does_not_hide_it(gap, width):
    paint, half = 1.84, 0.06
    beyond = (paint + half + gap + width, paint + half + gap, 25)
    before = (paint - half - gap, paint - half - gap - width, 25)
    for joint in (beyond, before):
        left, _ = seen(joint, (paint + half, paint - half, 160))
        assert left.y == pytest.approx(paint, abs=0.1)
        assert seen(joint) == (None, None)


def test_contrast_and_brightness_change_no_edge():
    part = np.full((64, 96), 80, np.uint8)
    part[:, 40:46] = 180
    at, _ = find_steep_edges(part)
    assert at.size > 0
    assert np.array_equal(find_steep_edges(part // 2 + 90)[0], at)


def test_a_camera_that_sees_no_road_is_refused():
    with pytest.raises(ConfigError, match="0 rows of road"):
        RoadRegion(CameraModel.from_view(width=640, rows=480, horizon=470.0, focal=600.0, height=1.2))
