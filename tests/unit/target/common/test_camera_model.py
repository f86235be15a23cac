"""All conversions between road and image use one pinhole model."""

from dataclasses import replace
from math import radians, tan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from selfdrive.common.camera_model import CameraModel

CALTECH = CameraModel()
SQUARE = CameraModel.from_view(width=640, rows=480, horizon=200.0, focal=600.0, height=1.22)
CAMERAS = pytest.mark.parametrize("model", [CALTECH, SQUARE, replace(CALTECH, pitch=0.0)])
ahead, sideways, turned = st.floats(3.0, 300.0), st.floats(-20.0, 20.0), st.floats(-0.3, 0.3)


def test_the_default_is_the_published_calibration():
    """The horizon is row 170.7, as in the Caltech frames. Lines 3.7 m apart diverge by 1.48 px per row."""
    assert pytest.approx(170.7, abs=0.05) == CALTECH.horizon
    assert CALTECH.lines_divergence() == pytest.approx(1.48, abs=0.005)
    assert CALTECH.pitch == pytest.approx(radians(14.0))


@CAMERAS
@given(x=ahead, y=sideways)
def test_project_agrees_with_row_and_column_for_road_points(model, x, y):
    assert model.project(x, y, 0.0) == pytest.approx((model.column(x, y), model.row(x)), abs=1e-6)


@CAMERAS
@given(x=ahead)
def test_row_and_distance_are_inverse(model, x):
    row = model.row(x)
    assert model.distance(row) == pytest.approx(x, rel=1e-6, abs=1e-6)
    assert model.metres_per_pixel(row) * (model.cx - model.column(x, 1.0)) == pytest.approx(1.0)


@CAMERAS
@given(y=sideways, slope=turned)
def test_a_straight_line_on_the_road_is_straight_in_the_picture(model, y, slope):
    a, b = model.line_in_picture(y, slope)
    for x in (4.0, 20.0, 100.0):
        assert a * model.row(x) + b == pytest.approx(model.column(x, y + slope * x), abs=1e-6)
    assert model.line_on_road(a, b) == pytest.approx((y, slope), abs=1e-9)


@CAMERAS
def test_far_points_at_camera_height_lie_on_the_horizon(model):
    far = 1e7
    assert model.project(far, 0.0, model.height)[1] == pytest.approx(model.horizon, abs=1e-3)
    assert model.project(20.0, 0.0, 1.0)[1] < model.project(20.0, 0.0, 0.0)[1]


def test_from_view_puts_the_horizon_at_the_requested_row():
    assert pytest.approx(200.0) == SQUARE.horizon
    assert (SQUARE.fx, SQUARE.fy, SQUARE.cx, SQUARE.cy) == (600.0, 600.0, 319.5, 239.5)
    assert tan(SQUARE.pitch) == pytest.approx((239.5 - 200.0) / 600.0)
