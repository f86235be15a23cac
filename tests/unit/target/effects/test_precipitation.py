"""Rain and snow in three dimensions: numbers, sizes, speeds and motion of the particles."""

from dataclasses import replace

import numpy as np
import pytest
from selfdrive.sim.effects import Rain, Snow
from selfdrive.sim.effects.particles import AirBox, ParticleCover, Particles, Streaks
from selfdrive.sim.picture import whole


def alone(camera, *, size=0.004, speed=0.0, reach=8.0, number=400):
    boxes = [AirBox(reach, np.full(number, size), np.full(number, speed))]
    return Particles(np.random.default_rng(2), camera, boxes)


def test_rain_has_marshall_and_palmers_spectrum(camera):
    """The number of drops in a box follows 8000 * exp(-slope * D), so small drops are more frequent."""
    rain = Rain(25.0, 0, camera).ready()
    slope = 4.1 * 25.0**-0.21
    sizes_of_all = 1000.0 * rain._particles._size
    for least, most in ((1.0, 2.0), (2.0, 3.0), (3.0, 6.0)):
        there = (least <= sizes_of_all) & (sizes_of_all < most)
        (reach,) = set(rain._particles._reach[there].tolist())
        sizes = sizes_of_all[there]
        volume = reach**3 * 640 / camera.fx * 480 / camera.fy
        expected = volume * 8000.0 / slope * (np.exp(-slope * least) - np.exp(-slope * most))
        assert sizes.size == pytest.approx(expected, abs=1.0)
    assert np.sum(sizes_of_all < 1.3) > np.sum((sizes_of_all > 1.7) & (sizes_of_all < 2.0))


def test_drops_fall_at_their_terminal_speed(camera):
    """A drop of 2 mm falls at 6.5 m/s and one of 5 mm at 9.1 m/s (measured by Gunn and Kinzer, 1949)."""
    _, speeds = Rain(10.0, 0, camera).sizes_and_speeds(np.array([2.0, 5.0]))
    assert speeds == pytest.approx([6.5, 9.1], rel=0.02)


def test_flakes_are_slow_and_large(camera):
    sizes, speeds = Snow(1.0, 0, camera).sizes_and_speeds(np.array([1.0]))
    assert 0.7 < speeds[0] < 1.1 and 0.002 < sizes[0] < 0.003


def test_particles_ahead_come_nearer(camera, moment):
    straight = replace(camera, pitch=0.0)
    particles = alone(straight)
    before = particles.streaks(moment()._replace(position=0.0), 0.0)
    after = particles.streaks(moment()._replace(position=0.5), 0.0)
    middle = np.array([[straight.cx], [straight.cy]])
    followed = 0
    for place, width in zip((before.start - middle).T, before.width, strict=True):
        depth = straight.fx * 0.004 / width
        expected = place * depth / (depth - 0.5)
        if depth > 1.0 and np.abs(expected[0]) < 300.0 and np.abs(expected[1]) < 200.0:
            followed += 1
            assert np.abs((after.start - middle).T - expected).sum(axis=1).min() < 0.05
    assert followed > 20


def test_falling_particles_sink(camera, moment):
    straight = replace(camera, pitch=0.0)
    particles = alone(straight, speed=6.0)
    before, after = (particles.streaks(moment()._replace(position=0.0, t=t), 0.0) for t in (1.0, 1.01))
    followed = 0
    for column, row, width in zip(*before.start, before.width, strict=True):
        sunk = row + straight.fy * 0.06 * width / (straight.fx * 0.004)
        if row > 0 and sunk < straight.rows:
            followed += 1
            assert np.abs(after.start - [[column], [sunk]]).sum(axis=0).min() < 0.05
    assert followed > 20


def test_a_streak_is_the_motion_during_the_exposure(camera, moment):
    particles = alone(camera, speed=5.0)
    now = moment()
    closed = now._replace(t=now.t + 0.002, position=now.position + 0.002 * now.v_ego)
    ends, later = particles.streaks(now, 0.002).end, particles.streaks(closed, 0.0).start
    inside = (ends[0] > 5) & (ends[0] < 630) & (ends[1] > 5) & (ends[1] < 470)
    near = [np.abs(later - end[:, None]).sum(axis=0).min() for end in ends.T[inside.nonzero()[0]]]
    assert np.median(near) < 0.05
    lengths = [
        np.median(np.hypot(*(streaks.end - streaks.start)))
        for streaks in (particles.streaks(moment(0, speed), 0.002) for speed in (0.0, 30.0))
    ]
    assert lengths[1] > 2.0 * lengths[0]


def test_boxes_repeat_without_gaps(camera, moment):
    particles = alone(camera, speed=7.0, number=3000)
    counts = [particles.streaks(moment(number), 0.001).width.size for number in range(0, 600, 40)]
    assert min(counts) > 0.7 * max(counts)


@pytest.mark.parametrize("width", [0.4, 1.2, 2.0, 5.0])
def test_streaks_block_the_light_of_their_area(width, camera):
    start = np.array([[100.3, 300.0, 500.7], [200.1, 240.5, 300.9]], np.float32)
    streaks = Streaks(start, start + np.float32(6.3), np.full(3, width, np.float32))
    taken = (
        ParticleCover(camera).covered_shares(streaks, whole((camera.rows, camera.width))).astype(float)
        / 255.0
    )
    assert taken.sum() == pytest.approx(3 * np.pi / 4 * width**2, rel=0.06)
    rows, columns = np.nonzero(taken[:, :200])
    assert np.average(columns, weights=taken[rows, columns]) == pytest.approx(103.45, abs=0.25)
    assert np.average(rows, weights=taken[rows, columns]) == pytest.approx(203.25, abs=0.25)


def test_particles_show_the_sky(camera, moment):
    flat = np.full((camera.rows, camera.width), 200, np.uint8)
    snow = Snow(4.0, 0, camera)
    assert np.abs(snow.apply(flat, moment()).astype(int) - 200).max() <= 1
    flat[200:] = 60
    seen = snow.apply(flat, moment())[300:].astype(int)
    assert seen.min() >= 59 and np.percentile(seen, 99.5) > 90


def test_snow_changes_less_between_frames_of_a_standing_car(camera, moment, road):
    snow = Snow(4.0, 0, camera)

    def change(speed):
        first, second = (snow.apply(road, moment(number, speed)).astype(int)[250:] for number in (0, 0.02))
        return np.abs(first - second).mean()

    assert change(0.0) < 0.5 * change(30.0)
