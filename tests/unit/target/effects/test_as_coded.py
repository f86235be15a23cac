"""Rain, fog, snow and occlusion as coded: amounts, positions, and a new drawing for each frame."""

import cv2
import numpy as np
import pytest
from selfdrive.sim.effects import CodedFog, CodedOcclusion, CodedRain, CodedSnow
from selfdrive.sim.effects.as_coded import FLAKE, _flake, _gaussian

EFFECTS = (CodedRain, CodedFog, CodedSnow, CodedOcclusion)


@pytest.fixture(scope="module")
def black(camera):
    return np.zeros((camera.rows, camera.width), np.uint8)


@pytest.mark.parametrize("effect", EFFECTS)
def test_each_frame_number_has_a_different_drawing(effect, camera, moment, road):
    one, other = effect(7, 3, camera), effect(7, 3, camera)
    later = other.apply(road, moment(5))
    assert np.array_equal(one.apply(road, moment(5)), later)
    change = [np.abs(one.apply(road, moment(k)).astype(int) - road) for k in (5, 6)]
    together = np.corrcoef(change[0].ravel(), change[1].ravel())[0, 1]
    assert together < 0.97  # both images have less contrast everywhere


@pytest.mark.parametrize("level", [2, 10])
def test_rain_covers_the_expected_share_of_the_image(camera, moment, black, level):
    """Each level adds 1,000 streaks of 32 pixels, spread over four times the area of the image."""
    rain = CodedRain(level, 3, camera).apply(black, moment())
    assert rain[rain > 0].min() == round(255 * 0.11)
    expected = 1000 * level * 31 / (4 * black.size)  # a streak has one pixel in each row
    assert -np.log(1.0 - (rain > 0).mean()) == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("level", [3, 10])
def test_fog_is_made_of_blurred_white_pixels(camera, moment, black, level):
    """Each level adds 15,000 white pixels, some at the same place.

    The road keeps 0.9 - 0.05 * level of its light.
    """
    fog = CodedFog(level, 3, camera).apply(black, moment())
    covered = 1.0 - np.exp(-15_000 * level / black.size)
    assert fog.mean() == pytest.approx(255 * covered, rel=0.02)
    grey = CodedFog(level, 3, camera).apply(black + 100, moment())
    assert grey.mean() - fog.mean() == pytest.approx(100 * (0.9 - 0.05 * level), abs=1.0)


@pytest.mark.parametrize("level", [1, 10])
def test_snow_is_made_of_fog_and_blocks(camera, moment, black, level):
    """Each level adds 250 blocks of 2 x 2 pixels. Blurring does not change their total light."""
    snow, fog = (effect(level, 3, camera).apply(black, moment()) for effect in (CodedSnow, CodedFog))
    blocks = (snow.mean() - fog.mean()) * black.size / (4 * 255)
    assert blocks == pytest.approx(250 * level, rel=0.15)


def test_occlusion_lies_on_the_road_and_has_a_rim(camera, moment, road):
    """Black blobs lie in the lower half and have a rim with grey levels up to 150."""
    seen = CodedOcclusion(10, 3, camera).apply(road, moment())
    changed = seen != road
    assert changed.any() and not changed[: camera.rows // 2 - 60].any()
    assert seen.min() == 0 and 140 <= seen[changed].max() < 150


def test_a_flake_is_a_blurred_block():
    block = np.zeros((40, 40), np.uint8)
    block[19:21, 19:21] = 255
    for layer in range(1, 11):
        blurred = _gaussian(0.5 + layer / 10.0)(block)
        middle = slice(20 - FLAKE // 2, 20 + FLAKE // 2)
        assert np.array_equal(_flake(0.5 + layer / 10.0), blurred[middle, middle])
        assert blurred.sum() == blurred[middle, middle].sum()


def test_gaussians_end_at_two_sigma():
    point = np.zeros((41, 41), np.float32)
    point[20, 20] = 255.0
    for sigma, reach in ((0.6, 2), (1.5, 3), (7.0, 14)):
        rows = cv2.reduce(_gaussian(sigma)(point), 1, cv2.REDUCE_SUM).ravel().nonzero()[0]
        assert (rows[0], rows[-1]) == (20 - reach, 20 + reach)
