"""Fog attenuates each pixel by Koschmieder's law, according to the pixel's distance."""

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects import Fog
from selfdrive.sim.effects.air import light_path_lengths

UDACITY = CameraModel.from_view(width=640, rows=480, horizon=200.0, focal=600.0, height=1.22)


@pytest.mark.parametrize("model", [CameraModel(), UDACITY])
def test_the_light_path_of_a_road_pixel_is_its_distance(model):
    """Straight ahead, the path's length follows from the camera's height and the distance on the road."""
    way = light_path_lengths(model)
    for x in (5.0, 20.0, 60.0):
        row, column = model.row(x), model.column(x, 0.0)
        above, share = int(row), row - int(row)
        # Below the horizon 1 / distance is almost linear in the row.
        inverse = (1.0 - share) / way[above, round(column)] + share / way[above + 1, round(column)]
        assert 1.0 / inverse == pytest.approx(np.hypot(x, model.height), rel=2e-3)


@pytest.mark.parametrize("visibility", [20.0, 40.0])
def test_at_the_visibility_5_percent_of_the_contrast_remains(visibility, camera, moment):
    """At half the visibility, the square root of 5 % of the contrast remains."""
    dark = np.full((camera.rows, camera.width), 50, np.uint8)
    dark[:170] = 200
    bright = dark.copy()
    bright[170:] = 250
    fog = Fog(visibility, 0, camera)
    left = fog.apply(bright, moment()).astype(float) - fog.apply(dark, moment())
    way = light_path_lengths(camera)
    for share, expected in ((1.0, 0.05), (0.5, 0.05**0.5)):
        there = np.abs(way / (share * visibility) - 1.0) < 0.01
        there[:180] = False
        assert there.sum() > 20
        assert left[there].mean() / 200.0 == pytest.approx(expected, rel=0.05)


def test_fog_follows_koschmieders_law_in_every_row(camera, moment, road):
    visibility = 60.0
    seen = Fog(visibility, 0, camera).apply(road, moment()).astype(float)
    kept = 0.05 ** (light_path_lengths(camera) / visibility)
    assert np.abs(seen - (kept * road + (1.0 - kept) * 205.0)).max() <= 1.0
    assert np.abs(seen[camera.rows // 3] - 205.0).max() <= 1.0
