"""The road view maps the image onto the road."""

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.visiond.road_view import CELL_WIDTH, RoadView

CAMERAS = {
    "steep": CameraModel(),
    "flat": CameraModel.from_view(width=640, rows=480, horizon=200, focal=579, height=1.21),
    "large": CameraModel.from_view(width=1280, rows=720, horizon=330, focal=1000, height=1.5),
}


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("y", [-1.85, 0.0, 1.3])
def test_a_line_along_the_road_is_vertical_in_the_map(name, y):
    model = CAMERAS[name]
    a, b = model.line_in_picture(y, 0.0)
    v, u = np.mgrid[: model.rows, : model.width]
    half = 0.1 * model.lines_divergence(1.0) * (v - model.horizon)
    picture = np.where(np.abs(u - (a * v + b)) <= half, 255, 40).astype(np.uint8)
    view = RoadView(model)
    road = view.map_picture(picture)
    assert road.dtype == np.uint8 and road.shape == (len(view.drop), len(view.y))
    column = model.cx - y * view.scale
    shown = (column > 0.2 * view.scale) & (column < model.width - 0.2 * view.scale)
    bright = road[shown].astype(float) - 40
    assert shown.sum() > 0.6 * len(shown)
    assert np.abs(bright @ view.y / bright.sum(axis=1) - y).max() < CELL_WIDTH


@pytest.mark.parametrize("name", CAMERAS)
def test_the_maps_rows_cover_the_rows_of_the_image(name):
    view = RoadView(CAMERAS[name])
    step = np.diff(view.drop)
    assert (step > 0).all() and step.max() <= view.share.max() + 1
    covered = view.drop[-1] - view.drop[0] + 1
    assert abs(view.share.sum() - covered) <= 4
    assert view.rows_with_content(np.zeros((len(view.drop), len(view.y)), np.uint8)) == 0.0


def test_near_rows_are_means_of_many_pixels():
    model = CameraModel()
    picture = (
        np.random.default_rng(1).normal(128, 30, (model.rows, model.width)).clip(0, 255).astype(np.uint8)
    )
    view = RoadView(model)
    road = view.map_picture(picture)
    middle = np.abs(view.y) < 1.5
    assert road[-10:][:, middle].std() < 0.4 * picture.std()


def test_a_camera_that_sees_no_road_near_enough_is_refused():
    far = CameraModel.from_view(width=640, rows=480, horizon=463, focal=600, height=1.35)
    with pytest.raises(ConfigError, match=r"calibration: 0 rows .* expected at least 8"):
        RoadView(far)
