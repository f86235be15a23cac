"""What an image effect is: a seeded, pure change of one grey picture of the camera.

Grey levels are taken as proportional to light, as machine-vision cameras deliver them, so that laws of
optics hold for them as they stand.
"""

from abc import ABC, abstractmethod
from math import isfinite
from typing import ClassVar, Protocol

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError

WHITE = 255


class Scene(Protocol):
    """What an effect knows of the world; the simulator's ground truth is one."""

    @property
    def t(self) -> float:
        """Time (s)."""
        ...

    @property
    def position(self) -> float:
        """Way driven along the road (m)."""
        ...

    @property
    def v_ego(self) -> float:
        """Speed (m/s)."""
        ...


class Effect(ABC):
    """One effect at one amount, in `UNIT`, from `LEAST` to `MOST`, for one camera.

    Everything random is drawn from the seed when the effect is made, in a stream of the effect's own: two
    effects with one seed are independent of each other. Afterwards nothing is kept from picture to
    picture, so that pictures may be asked for in any order. Raises ConfigError for an amount out of range.
    """

    UNIT: ClassVar[str]
    LEAST: ClassVar[float]
    MOST: ClassVar[float]
    WHOLE: ClassVar[bool] = False  # whether the amount counts something

    def __init__(self, amount: float, seed: int, camera: CameraModel) -> None:
        self._check(amount, seed)
        self.amount = amount
        self.seed = seed
        self.camera = camera
        self._prepare(np.random.Generator(np.random.PCG64([seed, *type(self).__name__.encode()])))

    def apply(self, picture: np.ndarray, scene: Scene) -> np.ndarray:
        """The picture, uint8 (rows, width), as this effect shows it at that moment; a new array.

        Raises ConfigError for a picture of another type or size than the camera's.
        """
        size = self.camera.rows, self.camera.width
        if picture.dtype != np.uint8 or picture.shape != size:
            got = f"{type(self).__name__}: a picture of {picture.dtype} and shape {picture.shape}"
            expected = f"uint8 and shape {size}, the camera's"
            raise ConfigError(got, expected=expected, remedy="give a grey picture of this camera")
        return self._affect(picture, scene)

    @property
    def thickness(self) -> float:
        """The amount's place between least and most, 0 to 1."""
        return (self.amount - self.LEAST) / (self.MOST - self.LEAST)

    @abstractmethod
    def _prepare(self, random: np.random.Generator) -> None:
        """Make what is the same for all pictures."""

    @abstractmethod
    def _affect(self, picture: np.ndarray, scene: Scene) -> np.ndarray:
        """The changed picture."""

    def _check(self, amount: float, seed: int) -> None:
        name = type(self).__name__
        kind = "a whole number" if self.WHOLE else "a number"
        fits = isfinite(amount) and self.LEAST <= amount <= self.MOST
        if not fits or (self.WHOLE and amount != int(amount)):
            expected = f"{kind} from {self.LEAST:g} to {self.MOST:g} ({self.UNIT})"
            raise ConfigError(f"{name}: amount {amount:g}", expected=expected, remedy="correct the amount")
        if not isinstance(seed, int) or seed < 0:
            expected = "a whole number, 0 or above"
            raise ConfigError(f"{name}: seed {seed!r}", expected=expected, remedy="correct the seed")
