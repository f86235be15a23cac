"""A Gaussian blur of grey pictures."""

import cv2
import numpy as np


class Gaussian:
    """Blurs uint8 pictures in a square of `size` pixels, which is chosen after `sigma` (px), or the other way
    round, where the one that is chosen is 0.

    `calculated_by` tells which compiled code it calculates with, if any.
    """

    calculated_by = ""

    def __init__(self, sigma: float, size: int = 0) -> None:
        self.size = size or round(6.0 * sigma + 1.0) | 1  # as OpenCV chooses it for bytes
        self._sigma = sigma

    def __call__(self, picture: np.ndarray) -> np.ndarray:
        """The blurred picture; beyond its borders its own mirror image lies."""
        return cv2.GaussianBlur(picture, (self.size, self.size), self._sigma)
