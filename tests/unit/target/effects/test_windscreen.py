"""Drops on the windscreen stay where they land until the wiper removes them."""

import numpy as np
import pytest
from selfdrive.sim.effects.gaussian import Gaussian
from selfdrive.sim.effects.windscreen import VIEW_BLUR, WIPE_PERIOD, Windscreen, shrink_picture
from selfdrive.sim.picture import whole


@pytest.fixture
def glass(camera):
    return Windscreen(
        np.random.default_rng(5), camera, 1000.0, np.full(50, 0.002), shrink_picture, Gaussian(VIEW_BLUR)
    )


def wet(glass, picture, moment, share, wipe=3):
    """Return the pixels that show drops at this fraction of the time between two wipes."""
    start = wipe * WIPE_PERIOD - glass._start
    return (
        glass.look_through(picture, whole(picture.shape), moment._replace(t=start + share * WIPE_PERIOD))
        != picture
    )


def test_drops_gather_until_the_wipe(glass, road, moment):
    early, late = (wet(glass, road, moment(), share) for share in (0.3, 0.9))
    assert 0 < early.sum() < 0.6 * late.sum()
    assert (late | ~early).mean() > 0.999
    assert wet(glass, road, moment(), 0.001, wipe=4).sum() < 0.1 * early.sum()
    other = wet(glass, road, moment(), 0.3, wipe=4)
    assert (early & other).sum() < 0.3 * early.sum()


def test_a_faster_car_meets_more_drops(glass, road, moment):
    slow, fast = (wet(glass, road, moment(speed=speed), 0.9).sum() for speed in (0.0, 26.8))
    assert 2.0 < fast / slow < 5.0
    assert wet(glass, road, moment(speed=90.0), 0.99).any()


def test_drops_show_the_scene_upside_down(glass, camera, moment):
    picture = np.full((camera.rows, camera.width), 60, np.uint8)
    picture[:200] = 200
    start = 3 * WIPE_PERIOD - glass._start
    seen = glass.look_through(picture, whole(picture.shape), moment()._replace(t=start + 0.9))
    change = seen.astype(int) - picture
    assert change[:190].max() <= 0 and change[:190].min() < -60
    assert change[210:].min() >= 0 and change[210:].max() > 60
