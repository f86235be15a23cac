"""The table-driven histograms of oriented gradients (HOG) agree with scikit-image."""

import numpy as np
import pytest
from selfdrive.visiond.hog import (
    CELL_PIXELS,
    ORIENTATION_BINS,
    WINDOW_FEATURES,
    WINDOW_PIXELS,
    WINDOW_STRIDE,
    Hog,
    _build_tables,
    detection_windows,
)
from skimage.feature import hog

TOLERANCE = 1e-6  # features are at most 1


def pictures() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(7)
    row, column = np.mgrid[:64, :96]
    return {
        "noise": rng.integers(0, 256, (64, 96)),
        "even": np.full((64, 96), 93),
        "chequer": 255 * ((row // 2 + column // 3) % 2),
        "slope": (3 * row + 5 * column) % 256,
    }


@pytest.mark.parametrize("name", pictures())
def test_blocks_equal_those_of_scikit_image(name):
    picture = pictures()[name].astype(np.uint8)
    expected = hog(picture, ORIENTATION_BINS, (CELL_PIXELS, CELL_PIXELS), (2, 2), "L2", feature_vector=False)
    blocks = Hog(*picture.shape).blocks(picture)
    assert np.abs(blocks.reshape(expected.shape) - expected).max() <= TOLERANCE


def test_a_window_has_the_features_of_its_part_of_the_image():
    """The border is not compared, because a separate image has no gradient there."""
    picture = pictures()["noise"].astype(np.uint8)
    shared = detection_windows(Hog(*picture.shape).blocks(picture))
    assert shared.shape == (3, 5, 7, WINDOW_FEATURES // 7)
    top, left = 1, 2
    part = picture[top * WINDOW_STRIDE :, left * WINDOW_STRIDE :][:WINDOW_PIXELS, :WINDOW_PIXELS]
    alone = hog(part, ORIENTATION_BINS, (CELL_PIXELS, CELL_PIXELS), (2, 2), "L2", feature_vector=False)
    inner = shared[top, left].reshape(alone.shape)[1:-1, 1:-1]
    assert np.abs(inner - alone[1:-1, 1:-1]).max() <= TOLERANCE


def test_contrast_and_brightness_change_no_feature():
    picture = np.random.default_rng(3).integers(0, 100, (64, 96)).astype(np.uint8)
    brighter = 2 * picture + 37
    tables = Hog(64, 96)
    before = tables.blocks(picture).copy()
    assert np.abs(tables.blocks(brighter) - before).max() <= TOLERANCE


def test_the_tables_have_the_angle_and_length_of_every_gradient():
    dx, dy = np.arange(-255, 256)[np.newaxis, :], np.arange(-255, 256)[:, np.newaxis]
    turned = np.degrees(np.arctan2(dy, dx)) % 180.0
    tables = _build_tables()
    assert np.array_equal(tables.orientation, (turned * ORIENTATION_BINS / 180.0).astype(np.uint8).ravel())
    assert np.array_equal(tables.length, (np.sqrt(dx * dx + dy * dy) / CELL_PIXELS**2).ravel())
