"""The base of image effects: seeded, pure changes of the camera's grey picture.

Grey levels are proportional to light, as in machine-vision cameras, so the laws of optics apply directly.
"""

from abc import ABC, abstractmethod
from dataclasses import astuple
from math import isfinite
from typing import ClassVar, NamedTuple, Protocol, Self

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.errors import ConfigError
from selfdrive.sim.picture import Picture, Region, whole

WHITE = 255


class Scene(Protocol):
    @property
    def t(self) -> float:
        """Time (s)."""
        ...

    @property
    def position(self) -> float:
        """Distance driven (m)."""
        ...

    @property
    def v_ego(self) -> float:
        """Speed (m/s)."""
        ...


class Moment(NamedTuple):
    t: float
    position: float
    v_ego: float


class Effect(ABC):
    """One effect at one amount, in `UNIT`, from `LEAST` to `MOST`, for one camera.

    Random numbers come from the seed and the effect's own stream, so two effects with one seed are
    independent. No state is kept between pictures, so they can be requested in any order. Raises ConfigError
    for an amount out of range.
    """

    UNIT: ClassVar[str]
    LEAST: ClassVar[float]
    MOST: ClassVar[float]
    WHOLE: ClassVar[bool] = False  # whether the amount is an integer
    MOVING: ClassVar[bool] = True  # False: the change is the same at any moment

    def __init__(self, amount: float, seed: int, camera: CameraModel) -> None:
        self._check(amount, seed)
        self.amount = amount
        self.seed = seed
        self.camera = camera
        made_of = amount, seed, astuple(camera), self._build()
        self._key = type(self).__module__, type(self).__name__, *made_of
        self._prepared = False

    def apply(self, picture: np.ndarray | Picture, scene: Scene) -> np.ndarray | Picture:
        """Return the picture, uint8 (rows, width), changed by this effect at that moment.

        Raises ConfigError for a picture of another type or size than the camera's.
        """
        size = self.camera.rows, self.camera.width
        if picture.dtype != np.uint8 or picture.shape != size:
            got = f"{type(self).__name__}: a picture of {picture.dtype} and shape {picture.shape}"
            expected = f"uint8 and shape {size}, the camera's"
            raise ConfigError(got, expected=expected, remedy="give a grey picture of this camera")
        moment = Moment(scene.t, scene.position, scene.v_ego) if self.MOVING else None
        if not isinstance(picture, Picture):
            return self._seen(picture, whole(size), moment)
        if not type(self).__module__.startswith(f"{__package__}."):  # no key for unknown code
            return self._seen(picture.pixels(), whole(size), moment)
        return picture.changed((self._key, moment), lambda region: self._seen(picture, region, moment))

    def ready(self) -> Self:
        """Prepare everything that is the same for all pictures; return self."""
        if not self._prepared:
            self._prepare(np.random.Generator(np.random.PCG64([self.seed, *type(self).__name__.encode()])))
            self._prepared = True
        return self

    def _seen(self, picture: np.ndarray | Picture, region: Region, moment: Moment | None) -> np.ndarray:
        """Return the changed region. Prepare only here, because many pictures are never examined."""
        return self.ready()._affect(picture, region, moment)

    @property
    def thickness(self) -> float:
        """The amount's position between least and most, 0 to 1."""
        return (self.amount - self.LEAST) / (self.MOST - self.LEAST)

    def _build(self) -> str:
        """Choose the implementations; return the digest of their compiled code, if any."""
        return ""

    @abstractmethod
    def _prepare(self, random: np.random.Generator) -> None:
        """Prepare what is the same for all pictures."""

    @abstractmethod
    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Moment | None) -> np.ndarray:
        """Return a region of the changed picture, with the same bits as in the whole.

        Use only the part of `picture` that is necessary. `scene` is None unless the effect is MOVING.
        """

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
