"""The band filter detects bright bands as wide as lane marks."""

import numpy as np
import pytest
from selfdrive.visiond.band_filter import find_mark_points

ROWS, COLUMNS = 60, 260


def road(*bands: tuple[int, int, float], ground: float = 90.0, noise: float = 1.5) -> np.ndarray:
    """Return a map with upright bands, each (first column, columns, brightness above the ground)."""
    picture = np.full((ROWS, COLUMNS), ground)
    for first, width, brighter in bands:
        picture[:, first : first + width] += brighter
    picture += np.random.default_rng(3).normal(0.0, noise, picture.shape)
    return picture.clip(0, 255).astype(np.uint8)


def support(picture: np.ndarray, first: int, last: int) -> float:
    """Return the weight of the points in these columns, as a share of the rows."""
    points = find_mark_points(picture)
    return float(points.weight[(points.column >= first) & (points.column < last)].sum()) / ROWS


@pytest.mark.parametrize("width", [2, 3, 4, 5])
@pytest.mark.parametrize("brighter", [15.0, 60.0, 140.0])
def test_the_middle_of_a_mark_is_found(width, brighter):
    picture = road((100, width, brighter))
    points = find_mark_points(picture)
    near = np.abs(points.column - (100 + 0.5 * (width - 1))) <= 1.0
    assert support(picture, 95, 110) > (0.5 if brighter < 20.0 else 0.8)
    assert points.weight[near].sum() > 0.95 * points.weight.sum() - 2.0


def test_a_double_line_is_found_as_one():
    picture = road((100, 3, 80.0), (106, 3, 80.0))
    assert support(picture, 100, 109) > 0.5


@pytest.mark.parametrize(
    "bands",
    [[(100, 3, -50.0)], [(100, 160, 60.0)], [(100, 25, 60.0)], []],
    ids=["tar seam", "concrete beside asphalt", "a bright strip of 1 m", "nothing"],
)
def test_only_bright_narrow_bands_are_found(bands):
    assert support(road(*bands), 0, COLUMNS) < 0.15


@pytest.mark.parametrize("light", [0.3, 0.6, 1.5])
def test_brightness_does_not_matter(light):
    bright = road((60, 3, 50.0), (180, 4, 70.0))
    picture = (bright * light).clip(0, 255).astype(np.uint8)
    assert support(picture, 58, 65) > 0.9 * support(bright, 58, 65)
    assert support(picture, 178, 186) > 0.9 * support(bright, 178, 186)


def test_points_on_rough_ground_have_little_weight():
    rough = road(noise=25.0)
    points = find_mark_points(rough)
    assert points.weight.sum() / ROWS * 7 / COLUMNS < 0.1
