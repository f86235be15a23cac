"""Glare and darkness."""

import numpy as np
import pytest
from selfdrive.sim.effects import LowLight, SunGlare
from selfdrive.sim.effects.light import pixel_rays


def test_rays_meet_the_horizon(camera):
    """Below the horizon, the slope of a ray is the camera's height divided by the distance to the road."""
    rays = pixel_rays(camera)
    fall = rays[:, round(camera.cx), 1] / rays[:, round(camera.cx), 2]
    assert np.interp(camera.horizon, np.arange(camera.rows), fall) == pytest.approx(0.0, abs=1e-4)
    row = camera.row(15.0)
    assert np.interp(row, np.arange(camera.rows), fall) == pytest.approx(camera.height / 15.0, rel=1e-3)


def test_glare_falls_off_with_the_square_of_the_angle(camera):
    veil = SunGlare(0.5, 3, camera).ready()._light.astype(float)
    more = SunGlare(1.0, 3, camera).ready()._light.astype(float)
    sky = veil[: int(camera.horizon)]
    row, column = np.unravel_index(sky.argmax(), sky.shape)
    assert abs(column - camera.cx) < 70 and sky[row, column] == 255
    rays = pixel_rays(camera)
    lit = (sky > 8) & (sky < 255)
    bright = sky == 255
    sun = rays[: int(camera.horizon)][bright].mean(axis=0)
    angle = np.degrees(np.arccos(np.clip(rays[: int(camera.horizon)] @ (sun / np.linalg.norm(sun)), -1, 1)))
    near, far = (np.median(sky[lit & (np.abs(angle - at) < 0.5)]) for at in (15.0, 30.0))
    assert near / far == pytest.approx(4.0, rel=0.25)
    assert np.median(more[lit.nonzero()] / veil[lit.nonzero()]) == pytest.approx(2.0, rel=0.15)


def test_noise_follows_the_number_of_electrons(camera, moment):
    flat = np.full((camera.rows, camera.width), 128, np.uint8)
    for lux in (100000.0, 100.0, 20.0):
        seen = LowLight(lux, 0, camera).apply(flat, moment()).astype(float)
        full = min(10000.0, 14.0 * lux)
        electrons = full * 128 / 255
        expected = 255 * np.sqrt(electrons + 25.0) / full
        assert seen.mean() == pytest.approx(128, abs=0.5)
        assert seen.std() == pytest.approx(np.hypot(expected, 0.29), rel=0.05)


def test_the_image_darkens_only_beyond_the_largest_gain(camera, moment, road):
    means = [LowLight(lux, 0, camera).apply(road, moment()).mean() for lux in (300.0, 15.0, 5.0, 0.5)]
    assert means[0] == pytest.approx(road.mean(), abs=1.0) and means[1] == pytest.approx(road.mean(), abs=3.0)
    assert means[2] < 0.6 * means[1] and means[3] < 0.2 * means[1]


def test_each_frame_has_new_noise(camera, moment):
    flat = np.full((camera.rows, camera.width), 128, np.uint8)
    low = LowLight(20.0, 0, camera)
    first, second = (low.apply(flat, moment(number)).astype(float).ravel() for number in (0, 1))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.01
