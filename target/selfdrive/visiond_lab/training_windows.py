"""Labelled detection windows from training scenes."""

from functools import lru_cache

import cv2
import numpy as np

from selfdrive.visiond.hog import WINDOW_FEATURES, WINDOW_PIXELS, WINDOW_STRIDE, Hog, detection_windows
from selfdrive.visiond.road_region import RoadRegion
from selfdrive.visiond_lab.training_scenes import VIEWS_PER_SCENE, TrainingView, generate_views

MOST_WINDOWS_PER_LABEL = 12  # largest number of windows per picture with a mark, and without one
MIN_MARK_PAINT = 40.0  # pixels of paint in a mark; windows between NO_PAINT and this are not used
MIN_MARK_CONTRAST = 6.0  # grey levels between paint and surroundings; windows with less are not used
MOST_PAINT_WITHOUT_MARK = 2.0  # pixels
SURROUNDINGS_KERNEL = np.ones((7, 7), np.uint8)  # neighbourhood for comparison with paint


def draw_labelled_windows(
    scenes: int, rng: np.random.Generator, *, with_effects: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Return features (windows x 1764, float32) and labels (bool), about half with a mark."""
    features = np.empty((2 * MOST_WINDOWS_PER_LABEL * VIEWS_PER_SCENE * scenes, WINDOW_FEATURES), np.float32)
    labels = np.empty(len(features), bool)
    used, hog_of_shape = 0, lru_cache(maxsize=1)(Hog)  # the views of a scene have one shape
    for view in generate_views(scenes, rng, with_effects=with_effects):
        region = RoadRegion(view.model)
        features_by_window = detection_windows(hog_of_shape(*region.shape).blocks(view.picture[region.part]))
        for label, weight in zip((True, False), _sampling_weights(view, region), strict=True):
            chosen = _draw_windows(weight * region.windows, rng)
            features[used : used + len(chosen)] = features_by_window[chosen[:, 0], chosen[:, 1]].reshape(
                -1, WINDOW_FEATURES
            )
            labels[used : used + len(chosen)] = label
            used += len(chosen)
    return features[:used], labels[:used]


def _draw_windows(weight: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    possible = np.argwhere(weight > 0.0)
    chance = weight[weight > 0.0]
    number = min(MOST_WINDOWS_PER_LABEL, len(possible))
    return (
        possible[rng.choice(len(possible), number, replace=False, p=chance / chance.sum())]
        if number
        else possible
    )


def _sampling_weights(view: TrainingView, region: RoadRegion) -> tuple[np.ndarray, np.ndarray]:
    """Sampling weight of each window (rows x columns) with a mark, and of each without.

    Windows with a visible mark have equal weights; the others have more weight the more edges they have,
    because only edges can mislead the detector.
    """
    picture = view.picture[region.part].astype(np.float32)
    paint = (view.paint[region.part] > 127).view(np.uint8)
    ring = (cv2.dilate(paint, SURROUNDINGS_KERNEL) - paint).astype(np.float32)
    paint = paint.astype(np.float32)
    amount, around = _sum_windows(paint), _sum_windows(ring)
    inside, outside = _sum_windows(picture * paint), _sum_windows(picture * ring)
    contrast = inside / np.maximum(amount, 1.0) - outside / np.maximum(around, 1.0)
    steepness = _sum_windows(np.abs(cv2.Sobel(picture, cv2.CV_32F, 1, 0)))
    with_mark = (amount >= MIN_MARK_PAINT) & (contrast >= MIN_MARK_CONTRAST)
    return with_mark.astype(np.float32), np.where(amount <= MOST_PAINT_WITHOUT_MARK, steepness + 1.0, 0.0)


def _sum_windows(image: np.ndarray) -> np.ndarray:
    rows, columns = (size // WINDOW_STRIDE for size in image.shape)
    tiles = image.reshape(rows, WINDOW_STRIDE, columns, WINDOW_STRIDE).sum(axis=(1, 3))
    assert WINDOW_PIXELS == 2 * WINDOW_STRIDE
    return tiles[:-1, :-1] + tiles[1:, :-1] + tiles[:-1, 1:] + tiles[1:, 1:]
