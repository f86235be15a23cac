"""The camera with frames shows a frame as seen from the car's pose."""

from dataclasses import replace

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim.camera import GeometryCamera
from selfdrive.sim.camera_and_detector import build_camera_and_detector
from selfdrive.sim.image_library import RENDERED_SPACING, FrameLibrary
from selfdrive.sim.moved_picture import HEADING_STEP, OFFSET_STEP, SHIFT_DISTANCE
from selfdrive.sim.picture_camera import PictureCamera
from selfdrive.sim.picture_options import (
    AUTHORS_CODE_TRANSLATION,
    GROUND_TRANSLATION,
    SHIFT_TRANSLATION,
    PictureOptions,
)
from selfdrive.sim.road import Road
from selfdrive.sim.road_renderer import RoadRenderer, first_road_row

CALTECH = CameraModel()
UDACITY = CameraModel.from_view(width=640, rows=480, horizon=200.0, focal=600.0, height=1.22)
CAMERAS = pytest.mark.parametrize("model", [CALTECH, UDACITY])


def camera(model, translation=GROUND_TRANSLATION, frames=12):
    renderer = RoadRenderer(model, "dashed", 3, periods=2)
    pictures = np.stack([renderer.render_grey(k * RENDERED_SPACING) for k in range(frames)])
    pictures.flags.writeable = False
    library = FrameLibrary(
        name="few", digest="d", model=model, frames=pictures, spacing=RENDERED_SPACING, fps=None
    )
    return PictureCamera(GeometryCamera(Road(None, None)), library, translation), renderer


@CAMERAS
@pytest.mark.parametrize(("offset", "heading"), [(0.4, 0.0), (0.0, 0.02), (-0.5, -0.02), (0.9, 0.03)])
def test_a_moved_frame_equals_the_road_rendered_from_that_pose(model, offset, heading, truth):
    """Below the horizon, only interpolation causes differences."""
    looking, renderer = camera(model)
    seen = looking.look(truth(lateral_offset=offset, heading=heading, position=3 * RENDERED_SPACING)).picture
    drawn = renderer.render_grey(3 * RENDERED_SPACING, offset, heading)
    still = renderer.render_grey(3 * RENDERED_SPACING)
    ground = slice(first_road_row(model) + 4, model.rows), slice(160, 480)
    error = np.abs(seen[ground].astype(int) - drawn[ground]).mean()
    assert error < 1.5
    assert np.abs(still[ground].astype(int) - drawn[ground]).mean() > 4.0 * error


@CAMERAS
def test_lines_in_a_moved_frame_are_at_their_true_place(model, truth):
    looking, renderer = camera(model)
    offset, heading = 0.32, -0.015
    picture = looking.look(truth(lateral_offset=offset, heading=heading)).picture.astype(float)
    a, b = model.line_in_picture(*renderer.true_lines(offset, heading)[0])
    errors = []
    for row in range(int(model.horizon) + 30, int(model.horizon) + 150):
        half = 0.25 / model.metres_per_pixel(row) + 3.0
        columns = np.arange(int(a * row + b - half), int(a * row + b + half) + 2)
        if columns[0] < 0:
            break
        light = np.clip(picture[row, columns] - 130.0, 0.0, None)
        errors.append(light @ columns / light.sum() - (a * row + b))
    assert len(errors) > 50
    assert abs(np.mean(errors)) < 0.1 and np.median(np.abs(errors)) < 0.15


def test_in_the_middle_of_the_lane_the_frame_is_unchanged(truth):
    looking, renderer = camera(CALTECH)
    picture = looking.look(truth(position=2.5 * RENDERED_SPACING)).picture
    assert np.array_equal(picture, renderer.render_grey(2 * RENDERED_SPACING))
    with pytest.raises(ValueError, match="read-only"):
        picture[0, 0] = 1


def test_poses_that_round_to_the_same_values_give_the_same_frame(truth):
    looking, _ = camera(CALTECH)
    exact = truth(lateral_offset=10 * OFFSET_STEP, heading=8 * HEADING_STEP)
    near = truth(lateral_offset=10.4 * OFFSET_STEP, heading=7.6 * HEADING_STEP)
    other = truth(lateral_offset=11 * OFFSET_STEP, heading=8 * HEADING_STEP)
    assert np.array_equal(looking.look(exact).picture, looking.look(near).picture)
    assert not np.array_equal(looking.look(exact).picture, looking.look(other).picture)


def test_the_rounding_is_finer_than_a_pixel(truth):
    row = CALTECH.rows - 1
    assert 0.5 * OFFSET_STEP / CALTECH.metres_per_pixel(row) < 0.5
    assert 0.5 * HEADING_STEP * CALTECH.fx < 0.5


def test_above_the_horizon_the_frame_only_pans(truth):
    looking, renderer = camera(CALTECH)
    frame = renderer.render_grey(0.0)
    aside = looking.look(truth(lateral_offset=0.8)).picture
    turned = looking.look(truth(heading=0.04)).picture
    far = first_road_row(CALTECH)
    shift = round(CALTECH.fx * np.tan(0.04) / np.cos(CALTECH.pitch))
    assert np.array_equal(aside[:far], frame[:far])
    assert np.array_equal(turned[:far, shift:], frame[:far, :-shift])
    assert (turned[:far, :shift] == frame[:far, :1]).all()


@pytest.mark.parametrize(("offset", "heading"), [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.01), (40.0, 0.0)])
def test_a_shift_moves_the_frame_as_a_whole(offset, heading, truth):
    """In the paper's mode, all rows shift as far as the lane does 10 m ahead."""
    looking, renderer = camera(CALTECH, SHIFT_TRANSLATION)
    picture = looking.look(truth(lateral_offset=offset, heading=heading)).picture
    away = offset + SHIFT_DISTANCE * np.tan(heading)
    shift = round(away / CALTECH.metres_per_pixel(CALTECH.row(SHIFT_DISTANCE)))
    columns = np.clip(np.arange(CALTECH.width) - shift, 0, CALTECH.width - 1)
    assert np.array_equal(picture, renderer.render_grey(0.0)[:, columns])


@pytest.mark.parametrize("offset", [0.5, -0.9, 3.0])
def test_as_coded_the_frame_shifts_by_a_fixed_scale(truth, offset):
    """The whole image shifts by a pixel for each 0.03895 m, up to 1 m. The car's heading has no effect."""
    looking, renderer = camera(CALTECH, AUTHORS_CODE_TRANSLATION)
    picture = looking.look(truth(lateral_offset=offset, heading=0.02)).picture
    shift = round(min(max(offset, -1.0), 1.0) / 0.03895)
    columns = np.clip(np.arange(CALTECH.width) - shift, 0, CALTECH.width - 1)
    assert np.array_equal(picture, renderer.render_grey(0.0)[:, columns])


def test_only_the_image_differs_from_the_ideal_cameras_message(truth):
    looking, _ = camera(CALTECH)
    there = truth(lateral_offset=0.3, heading=0.01, d_rel=42.0)
    assert looking.look(there)._replace(picture=None) == GeometryCamera(Road(None, None)).look(there)


def test_frames_of_any_size_are_moved(truth):
    small = CameraModel.from_view(width=320, rows=117, horizon=-5.0, focal=260.0, height=1.5)
    looking, renderer = camera(replace(small), frames=1)
    picture = looking.look(truth(lateral_offset=0.4, heading=0.01)).picture
    drawn = renderer.render_grey(0.0, 0.4, 0.01)
    assert picture.shape == (117, 320)
    assert np.abs(picture[:, 80:240].astype(int) - drawn[:, 80:240]).mean() < 1.5


def test_a_road_with_curvature_is_refused():
    """Frames show a straight road."""
    with pytest.raises(ConfigError, match="a road with curvature, expected a straight road"):
        build_camera_and_detector(PictureOptions(), Road(None, ((0.0, 100.0), (0.0, 0.001))), 0)


@pytest.mark.parametrize("translation", [GROUND_TRANSLATION, SHIFT_TRANSLATION, AUTHORS_CODE_TRANSLATION])
@CAMERAS
def test_a_region_equals_that_of_the_whole_frame(model, translation, truth):
    looking, _ = camera(model, translation, frames=1)
    random = np.random.default_rng(4)
    for _ in range(60):
        pose = truth(lateral_offset=random.normal(0.0, 0.4), heading=random.normal(0.0, 0.02))
        row, column = random.integers(0, (model.rows - 1, model.width - 1))
        last, right = random.integers((row + 1, column + 1), (model.rows + 1, model.width + 1))
        part = looking.look(pose).picture[row:last, column:right]
        assert np.array_equal(part, looking.look(pose).picture.pixels()[row:last, column:right])
