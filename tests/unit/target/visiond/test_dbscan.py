"""The exact DBSCAN on masks agrees with scikit-learn's DBSCAN."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from selfdrive.visiond.dbscan import NOISE, dbscan
from sklearn.cluster import DBSCAN


def labels(mask: np.ndarray, eps: int, min_samples: int) -> list[int]:
    return dbscan(np.flatnonzero(mask), mask.shape, eps, min_samples).tolist()


def expected(mask: np.ndarray, eps: int, min_samples: int) -> list[int]:
    points = np.argwhere(mask)
    if not len(points):
        return []
    return DBSCAN(eps=eps, min_samples=min_samples, metric="chebyshev").fit_predict(points).tolist()


@settings(max_examples=80, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 2**32 - 1),
    rows=st.integers(1, 60),
    width=st.integers(1, 60),
    share=st.floats(0.0, 0.6),
    eps=st.integers(1, 6),
    need=st.floats(0.0, 1.5),
)
def test_random_masks_get_the_labels_of_scikit_learn(seed, rows, width, share, eps, need):
    mask = (np.random.default_rng(seed).random((rows, width)) < share).astype(np.uint8)
    min_samples = 1 + int(need * share * (2 * eps + 1) ** 2)
    assert labels(mask, eps, min_samples) == expected(mask, eps, min_samples)


@pytest.mark.parametrize(("eps", "min_samples"), [(1, 2), (3, 6), (4, 10), (6, 30)])
def test_thin_lines_get_the_labels_of_scikit_learn(eps, min_samples):
    rng = np.random.default_rng(eps)
    mask = np.zeros((128, 320), np.uint8)
    for _ in range(25):
        ends = rng.integers(0, (320, 128), (2, 2)).tolist()
        cv2.line(mask, ends[0], ends[1], 1)
    mask &= (rng.random(mask.shape) < 0.8).astype(np.uint8)
    assert labels(mask, eps, min_samples) == expected(mask, eps, min_samples)


def test_a_pixel_between_two_clusters_belongs_to_the_first():
    mask = np.array([[1, 1, 1, 0, 0, 0, 1, 1, 1]] * 3, np.uint8)
    mask[1, 4] = 1
    assert labels(mask, 2, 8) == [0, 0, 0, 1, 1, 1, 0, 0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1]


def test_a_lone_pixel_is_noise_and_an_empty_mask_has_no_labels():
    mask = np.zeros((5, 5), np.uint8)
    assert labels(mask, 2, 3) == []
    mask[2, 2] = 1
    assert labels(mask, 2, 3) == [NOISE]
