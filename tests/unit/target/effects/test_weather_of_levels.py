"""The paper's effect levels match physical amounts of rain, snow and fog."""

from itertools import pairwise

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects import Rain, Snow
from selfdrive.sim.effects.weather_of_levels import (
    MIN_BLOCK_SIZE,
    MIN_STREAK_DROP,
    REACH,
    fog_of_contrast,
    rain_of_level,
    snow_of_level,
)


def test_rain_has_the_papers_number_of_near_drops(camera):
    """At level 10, 10,000 drops of 1 mm or more are within range, by Marshall and Palmer's distribution."""
    weather = rain_of_level(10, camera)
    fall = Rain(weather.rate, 0, camera)
    pyramid = REACH**3 / 3 * camera.width / camera.fx * camera.rows / camera.fy
    assert fall.particle_density(MIN_STREAK_DROP, fall.largest_diameter()) * pyramid == pytest.approx(
        10_000, rel=1e-6
    )
    assert 2 < rain_of_level(1, camera).rate < 5 and 50 < weather.rate < 100


def test_snow_has_the_papers_number_of_block_sized_flakes(camera):
    """Level 10 has 1,000 flakes within the distance at which a flake appears as large as a block."""
    weather = snow_of_level(10, camera)
    fall = Snow(weather.rate, 0, camera)
    count, step = 0.0, 0.01
    for k in range(round(fall.largest_diameter() / step)):
        size, _ = fall.sizes_and_speeds(np.array([step * (k + 0.5)]))
        reach = camera.fy * size.item() / MIN_BLOCK_SIZE
        near = reach**3 / 3 * camera.width / camera.fx * camera.rows / camera.fy
        count += fall.particle_density(step * k, step * (k + 1)) * near
    assert count == pytest.approx(1_000, rel=0.01)


def test_higher_levels_have_a_shorter_visibility(camera):
    for kind in (rain_of_level, snow_of_level):
        weather = [kind(level, camera) for level in range(1, 11)]
        assert all(a.rate < b.rate and a.visible_range > b.visible_range for a, b in pairwise(weather))


def test_fog_leaves_the_given_contrast():
    """The contrast applies to the middle of the measured road, at 17.5 m. At a distance equal to the
    visibility, it is 5 %."""
    assert fog_of_contrast(0.05).visible_range == pytest.approx(17.5)
    assert fog_of_contrast(0.9).visible_range > fog_of_contrast(0.4).visible_range > 50.0


def test_a_rate_below_the_possible_ones_becomes_the_lowest():
    """A camera with a very wide view would need a lower rate."""
    wide = CameraModel(fx=30.0, fy=30.0)
    assert snow_of_level(0.0001, wide).rate == pytest.approx(Snow.LEAST)
