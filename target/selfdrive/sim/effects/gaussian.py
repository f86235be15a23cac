"""A Gaussian blur of grey pictures."""

import cv2
import numpy as np


class Gaussian:
    """Blurs uint8 pictures with a square kernel of `size` pixels and width `sigma` (px); if one is 0, it
    follows from the other.

    `calculated_by` identifies the compiled code in use, if any.
    """

    calculated_by = ""

    def __init__(self, sigma: float, size: int = 0) -> None:
        self.size = size or round(6.0 * sigma + 1.0) | 1  # OpenCV's choice for bytes
        self._sigma = sigma

    def __call__(self, picture: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(picture, (self.size, self.size), self._sigma)
