"""Every effect is pure and seeded, keeps grey levels in range, and rejects invalid input."""

from dataclasses import replace
from functools import cache
from math import inf, nan

import numpy as np
import pytest
from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim import effects
from selfdrive.sim.effects.levels import AMOUNTS_BY_EFFECT
from selfdrive.sim.picture import Picture, Region

ALL = sorted(AMOUNTS_BY_EFFECT, key=lambda effect: effect.__name__)
MOVING = [
    effects.PaperRain,
    effects.PaperFog,
    effects.PaperSnow,
    effects.CodedRain,
    effects.CodedFog,
    effects.CodedSnow,
    effects.CodedOcclusion,
    effects.Rain,
    effects.Snow,
    effects.LowLight,
]
STILL = [effect for effect in ALL if effect not in MOVING]
RANDOM = [*MOVING, effects.PaperOcclusion, effects.LensMud, effects.SunGlare]
HD = CameraModel.from_view(width=1280, rows=720, horizon=238.0, focal=1000.0, height=1.5)

every = pytest.mark.parametrize("effect", ALL)


def fresh(effect, camera, seed=3):
    return effect(AMOUNTS_BY_EFFECT[effect][-1], seed, camera)


strongest = cache(fresh)  # for tests that can share an effect


def test_every_exported_effect_has_levels():
    """Pages and benchmarks use the levels."""
    assert {effect.__name__ for effect in AMOUNTS_BY_EFFECT} == set(effects.__all__)


@every
def test_frames_are_the_same_in_any_order(effect, camera, moment, road):
    one, other = strongest(effect, camera), fresh(effect, camera)
    forwards = [one.apply(road, moment(number)) for number in range(4)]
    backwards = [other.apply(road, moment(number)) for number in reversed(range(4))][::-1]
    for first, second in zip(forwards, backwards, strict=True):
        assert np.array_equal(first, second)


@every
def test_the_input_is_unchanged_and_the_output_is_a_new_image(effect, camera, moment, road):
    before = road.copy()
    after = strongest(effect, camera).apply(road, moment())
    assert after.dtype == np.uint8 and after.shape == road.shape
    assert not np.shares_memory(after, road)
    assert np.array_equal(road, before) and not np.array_equal(after, road)


@every
def test_later_frames_do_not_change_earlier_results(effect, camera, moment, road):
    made = strongest(effect, camera)
    first = made.apply(road, moment())
    kept = first.copy()
    made.apply(255 - road, moment(1))
    assert np.array_equal(first, kept)


CAMERAS = [
    CameraModel(),
    CameraModel.from_view(width=352, rows=264, horizon=90.0, focal=200.0, height=1.4),
    CameraModel.from_view(
        width=333, rows=251, horizon=70.3, focal=180.0, height=1.4
    ),  # the size is not a multiple of a vector's length
]


def regions(shape, random):
    for _ in range(6):
        top, left = (int(random.integers(size)) for size in shape)
        bottom, right = random.integers((top + 1, left + 1), (shape[0] + 1, shape[1] + 1)).tolist()
        yield Region(top, bottom, left, right)
    for top in (0, shape[0] - 1):
        for left in (0, shape[1] - 1):
            yield Region(top, top + 1, left, left + 1)


@pytest.mark.parametrize("model", CAMERAS, ids=["640x480", "352x264", "333x251"])
@every
def test_a_region_has_the_same_bits_as_in_the_whole_image(effect, model, moment):
    random = np.random.default_rng(7)
    noise = random.integers(0, 256, (model.rows, model.width), np.uint8)
    for amount in (AMOUNTS_BY_EFFECT[effect][0], AMOUNTS_BY_EFFECT[effect][-1]):
        made, before = effect(amount, 3, model), effects.GaussianBlur(5, 3, model)
        for number in (0, 17):
            once = Picture(("noise",), noise.shape, lambda region: noise[region.part])
            shown = made.apply(once, moment(number))
            pixels = made.apply(noise, moment(number))
            twice = made.apply(before.apply(once, moment(number)), moment(number))
            for region in regions(noise.shape, random):
                assert np.array_equal(shown[region.part], pixels[region.part])
            assert np.array_equal(twice[region.part], np.asarray(twice)[region.part])
            assert np.array_equal(twice, made.apply(before.apply(noise, moment(number)), moment(number)))


@pytest.mark.parametrize("effect", RANDOM)
def test_another_seed_gives_another_image(effect, camera, moment, road):
    one, other = (fresh(effect, camera, seed).apply(road, moment()) for seed in (1, 1 + 2**32))
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("effect", STILL)
def test_still_effects_do_not_move(effect, camera, moment, road):
    made = strongest(effect, camera)
    assert np.array_equal(made.apply(road, moment()), made.apply(road, moment(17, speed=5.0)))


@pytest.mark.parametrize("effect", MOVING)
def test_moving_effects_move(effect, camera, moment, road):
    made = strongest(effect, camera)
    assert not np.array_equal(made.apply(road, moment()), made.apply(road, moment(1)))


@every
@pytest.mark.parametrize("level", [0, 255])
def test_grey_levels_do_not_wrap_around(effect, camera, moment, level):
    flat = np.full((camera.rows, camera.width), level, dtype=np.uint8)
    after = strongest(effect, camera).apply(flat, moment()).astype(int)
    grey = strongest(effect, camera).apply(np.full_like(flat, 128), moment()).astype(int)
    noise = 60 if effect is effects.LowLight else 4
    assert (after <= grey + noise).all() if level == 0 else (after >= grey - noise).all()


@every
def test_large_frames_work(effect, moment):
    picture = np.full((HD.rows, HD.width), 95, dtype=np.uint8)
    assert strongest(effect, HD).apply(picture, moment()).shape == picture.shape


@pytest.mark.parametrize("effect", [effects.Rain, effects.Snow, effects.PaperRain, effects.Fog])
def test_odd_sizes_work(effect, camera, moment):
    odd = replace(camera, width=321, rows=243, cx=160.0, cy=130.0)
    picture = np.full((odd.rows, odd.width), 95, dtype=np.uint8)
    assert strongest(effect, odd).apply(picture, moment()).shape == picture.shape


@every
def test_wrong_amounts_are_refused(effect, camera):
    for amount in (effect.LEAST - 1.0, 2.0 * effect.MOST + 1.0, nan, inf):
        with pytest.raises(ConfigError, match=f"{effect.__name__}: amount .*, expected .*{effect.MOST:g}"):
            effect(amount, 0, camera)


@pytest.mark.parametrize("effect", [effects.PaperOcclusion, effects.AveragingBlur])
def test_numbers_of_blobs_and_pixels_must_be_whole(effect, camera):
    with pytest.raises(ConfigError, match=r"amount 2\.5, expected a whole number"):
        effect(2.5, 0, camera)


@pytest.mark.parametrize("effect", [effects.GaussianBlur, effects.MedianBlur])
def test_kernel_sizes_must_be_odd(effect, camera):
    """An even kernel has no middle."""
    with pytest.raises(ConfigError, match="amount 4, expected an odd number"):
        effect(4, 0, camera)


@every
@pytest.mark.parametrize("seed", [-1, 1.5])
def test_wrong_seeds_are_refused(effect, camera, seed):
    with pytest.raises(ConfigError, match="seed"):
        effect(AMOUNTS_BY_EFFECT[effect][0], seed, camera)


@pytest.mark.parametrize(
    "picture",
    [
        np.zeros((480, 640), np.float32),
        np.zeros((480, 640, 3), np.uint8),
        np.zeros((240, 320), np.uint8),
    ],
)
def test_pictures_of_another_camera_are_refused(camera, moment, picture):
    with pytest.raises(
        ConfigError, match=r"Brightness: a picture of .* expected uint8 and shape \(480, 640\)"
    ):
        effects.Brightness(10, 0, camera).apply(picture, moment())


@every
def test_severity_grows_with_the_level(effect, camera, moment, road):
    amounts = AMOUNTS_BY_EFFECT[effect]
    chosen = sorted({0, len(amounts) // 2, len(amounts) - 1})
    errors = []
    for number in chosen:
        after = effect(amounts[number], 5, camera).apply(road, moment()).astype(float)
        errors.append(((after - road) ** 2).mean())
    assert errors == sorted(errors) and errors[0] < errors[-1]
