"""Contrast, brightness and blur, which the paper takes from DeepTest (Tian and others, 2018)."""

import cv2
import numpy as np

from selfdrive.common.errors import ConfigError
from selfdrive.sim.effects.canvas import filtered
from selfdrive.sim.effects.compiled_gaussian import build_gaussian
from selfdrive.sim.effects.effect import WHITE, Effect, Scene
from selfdrive.sim.picture import Picture, Region


class _Tone(Effect):
    """Changes each grey level independently of its place."""

    MOVING = False

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        return cv2.LUT(picture[region.part], self._levels)

    def _set(self, levels: np.ndarray) -> None:
        self._levels = np.clip(np.rint(levels), 0, WHITE).astype(np.uint8)


class Contrast(_Tone):
    """Every level is multiplied by a gain and limited to white. The paper's gains: 1.2 to 3.0."""

    UNIT, LEAST, MOST = "gain", 0.0, 10.0

    def _prepare(self, random: np.random.Generator) -> None:
        self._set(self.amount * np.arange(WHITE + 1))


class Brightness(_Tone):
    """A bias is added to every level. The paper's biases: 10 to 100."""

    UNIT, LEAST, MOST = "grey levels", -255.0, 255.0

    def _prepare(self, random: np.random.Generator) -> None:
        self._set(self.amount + np.arange(WHITE + 1))


class AveragingBlur(Effect):
    """The mean of a square. The paper's kernels: 3, 4, 5, 6."""

    UNIT, LEAST, MOST, WHOLE, MOVING = "px", 1, 31, True, False

    def _prepare(self, random: np.random.Generator) -> None:
        self._kernel = int(self.amount), int(self.amount)

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        return filtered(picture, region, self._kernel[0], lambda wide: cv2.blur(wide, self._kernel))


class _OddKernel(Effect):
    """A blur whose kernel has a central pixel."""

    def _prepare(self, random: np.random.Generator) -> None:
        """Prepare nothing."""

    def _check(self, amount: float, seed: int) -> None:
        super()._check(amount, seed)
        if amount % 2 != 1:
            name, expected = type(self).__name__, f"an odd number of {self.UNIT}"
            raise ConfigError(f"{name}: amount {amount:g}", expected=expected, remedy="correct the amount")


class GaussianBlur(_OddKernel):
    """A Gaussian in a square kernel that determines its width. The paper's kernels: 3, 5, 7."""

    UNIT, LEAST, MOST, WHOLE, MOVING = "px", 1, 31, True, False

    def _build(self) -> str:
        self._blur = build_gaussian(0.0, int(self.amount))
        return self._blur.calculated_by

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        return filtered(picture, region, self._blur.size // 2, self._blur)


class MedianBlur(_OddKernel):
    """The median of a square. The paper's apertures: 3 and 5."""

    UNIT, LEAST, MOST, WHOLE, MOVING = "px", 1, 31, True, False

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        size = int(self.amount)
        return filtered(picture, region, size, lambda wide: cv2.medianBlur(wide, size))
