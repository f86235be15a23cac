"""The paper's effects have the paper's parameters, motion, and numbers of streaks, blocks and blobs."""

import numpy as np
import pytest
from selfdrive.sim.effects import Brightness, Contrast, PaperFog, PaperOcclusion, PaperRain, PaperSnow
from selfdrive.sim.effects.paper_weather import BLOCKS, STREAKS, motion_kernel
from selfdrive.sim.picture import whole


def black(camera):
    return np.zeros((camera.rows, camera.width), dtype=np.uint8)


@pytest.mark.parametrize("thickness", [1, 3, 10, 2.5])
@pytest.mark.parametrize(("effect", "each"), [(PaperRain, 1000), (PaperSnow, 100)])
def test_thickness_sets_the_number_of_streaks_and_blocks(effect, each, thickness, camera):
    made = effect(thickness, 0, camera)
    assert {PaperRain: STREAKS, PaperSnow: BLOCKS}[effect] == each
    assert sum(made._count(each, layer, 5) for layer in range(5)) == each * thickness


def test_the_requested_number_of_streaks_is_drawn(camera, moment, monkeypatch):
    """Streaks that touch are counted as one."""
    cv2 = pytest.importorskip("cv2")
    monkeypatch.setattr("selfdrive.sim.effects.paper_weather.STREAKS", 100)
    picture = PaperRain(1, 0, camera).apply(black(camera), moment())
    found, _ = cv2.connectedComponents((picture > 0).astype(np.uint8))
    assert 80 <= found - 1 <= 110


@pytest.mark.parametrize("effect", [PaperRain, PaperSnow])
def test_falling_layers_wrap_around(effect, camera, moment):
    """A drop that leaves the image enters it again on the opposite side, so a layer keeps its grey levels."""
    made = effect(3, 0, camera).ready()
    everything = whole((camera.rows, camera.width))
    for tile in made._tiles:
        first, later = tile.moved(0.0, 0.0, everything), tile.moved(-35.0, 412.0, everything)
        assert np.array_equal(np.sort(first, axis=None), np.sort(later, axis=None))


@pytest.mark.parametrize("effect", [PaperRain, PaperSnow])
def test_every_layer_falls(effect, camera, moment):
    made = effect(1, 0, camera).ready()
    ways = []
    for tile in made._tiles:

        def moved(right, down, region):
            ways.append(down)
            return black(camera)

        tile.moved = moved
    made.apply(black(camera), moment(0))
    made.apply(black(camera), moment(1))
    before, after = np.array(ways).reshape(2, -1)
    steps = after - before
    assert (np.diff(steps) > 0.0).all() and steps[0] > 5.0 and steps[-1] < camera.rows / 2


def test_more_snow_includes_the_blocks_of_less(camera, moment):
    less, more = (PaperSnow(level, 0, camera)._blocks(np.random.default_rng(1), 0) for level in (2, 6))
    assert (more >= less).all() and more.sum() > 2 * less.sum()


def test_rain_dims_the_background(camera, moment, road):
    for thickness, alpha in ((1, 0.75), (10, 0.65)):
        made = PaperRain(thickness, 0, camera)
        flat = np.full_like(road, 100)
        assert made.apply(flat, moment()).min() == round(100 * alpha)


def test_fog_reduces_contrast_evenly(camera, moment):
    for thickness, alpha in ((1, 0.9), (10, 0.4)):
        made = PaperFog(thickness, 0, camera)
        dark, bright = (
            made.apply(np.full((camera.rows, camera.width), level, np.uint8), moment()).astype(int)
            for level in (20, 120)
        )
        assert np.median(bright - dark) == 100 * alpha


def test_fog_noise_is_uniform_and_blurred(camera, moment):
    fog = PaperFog(10, 0, camera).apply(black(camera), moment()).astype(float)
    assert abs(fog.mean() - 127.5) < 1.0
    # 73.6 / (2 * sqrt(pi) * sigma) for sigma = 7
    assert fog.std() == pytest.approx(73.6 / (2 * np.pi**0.5 * 7.0), rel=0.15)


@pytest.mark.parametrize("blobs", [1, 4, 10])
def test_blobs_have_the_papers_number_and_size(blobs, camera, moment):
    white = np.full((camera.rows, camera.width), 200, np.uint8)
    share = 1.0 - PaperOcclusion(blobs, 4, camera).apply(white, moment()).astype(float) / 200.0
    area = share.sum() / 0.9
    assert blobs * np.pi * 5.0**2 * 0.2 < area < blobs * np.pi * 51.0**2
    fewer = PaperOcclusion(1, 4, camera).apply(white, moment())
    assert (200 - 200 * share <= fewer + 2).all()


def test_blobs_lie_on_the_road(camera, moment):
    white = np.full((camera.rows, camera.width), 200, np.uint8)
    for seed in range(20):
        seen = PaperOcclusion(10, seed, camera).apply(white, moment())
        assert (seen[: int(camera.horizon) - 70] == 200).all() and (seen < 100).any()


def test_motion_blur_has_the_papers_length_and_angle():
    """Snow's motion blur is 5 pixels long at 75 degrees: mostly up and slightly to the right."""
    kernel = motion_kernel(5, 75.0)
    rows, columns = np.nonzero(kernel > 0.01)
    assert kernel.sum() == pytest.approx(1.0, abs=1e-6)
    assert np.ptp(rows) in (4, 5) and np.ptp(columns) in (1, 2, 3)
    up = np.average(np.arange(len(kernel)), weights=kernel[: len(kernel) // 2].sum(axis=0))
    assert up > len(kernel) // 2


def test_contrast_and_brightness_saturate(camera, moment, road):
    strong = Contrast(3.0, 0, camera).apply(road, moment())[300:]
    bright = Brightness(100, 0, camera).apply(road, moment())[300:]
    assert strong.min() == 255
    assert bright.max() == 255 and bright.min() == 195
