"""Light on its way through air: what is left of it, and the airlight that takes its place.

Koschmieder's law: over a distance d through air of extinction b a share exp(-b * d) of an object's light
arrives, and the rest is replaced by airlight, the level of the horizon. Visibility is the distance over
which contrast falls to 5 %, so b = -ln(0.05) / visibility (meteorological optical range, WMO No. 8).
"""

from math import cos, exp, log, sin

import cv2
import numpy as np

from selfdrive.common.array_math import each
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import Effect, Scene
from selfdrive.sim.picture import Picture, Region

THRESHOLD = 0.05
LAYER = 100.0  # m: above the road there is clear sky again


def extinction(visibility: float) -> float:
    """Extinction coefficient (1/m) of air with this visibility (m)."""
    return -log(THRESHOLD) / visibility


def ways(camera: CameraModel) -> np.ndarray:
    """Way of each pixel's light (m) through the layer of air: from the road, or from the layer's top.

    Float32 (rows, width); infinite at the horizon. The road is flat, and nothing stands on it.
    """
    right = (np.arange(camera.width) - camera.cx) / camera.fx
    down = ((np.arange(camera.rows) - camera.cy) / camera.fy)[:, None]
    fall = (sin(camera.pitch) + down * cos(camera.pitch)) / np.sqrt(1.0 + right**2 + down**2)
    with np.errstate(divide="ignore"):
        way = np.where(fall > 0.0, camera.height / fall, (LAYER - camera.height) / np.abs(fall))
    return way.astype(np.float32)


def clearness(coefficient: float, camera: CameraModel) -> np.ndarray:
    """Share of each pixel's light, float32, that air of this extinction coefficient (1/m) lets through."""
    return each(exp, np.float32(-coefficient) * ways(camera)).astype(np.float32)


def airlight(picture: np.ndarray | Picture, camera: CameraModel) -> float:
    """Grey level of the air: the mean above the horizon, or of the uppermost tenth where little is above."""
    rows = max(int(camera.horizon), camera.rows // 10)
    return cv2.mean(picture[:rows, :])[0]


def veiled(picture: np.ndarray, veil: np.ndarray, taken: np.ndarray, air: float) -> np.ndarray:
    """The picture through a veil that keeps its light, and particles that take of it; `air` takes its place.

    All are uint8 of one shape, shares in parts of 255; `air` is a grey level.
    """
    kept = cv2.multiply(veil, cv2.bitwise_not(taken), scale=1.0 / 255.0)
    lost = cv2.convertScaleAbs(kept, alpha=-air / 255.0, beta=air)  # air * (1 - kept / 255)
    return cv2.add(cv2.multiply(picture, kept, scale=1.0 / 255.0), lost)


class Fog(Effect):
    """Even fog of a given visibility."""

    UNIT, LEAST, MOST, MOVING = "m", 5.0, 20000.0, False

    def _prepare(self, random: np.random.Generator) -> None:
        self._kept = clearness(extinction(self.amount), self.camera)
        self._lost = 1.0 - self._kept

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        part = region.part
        air = np.full(region.shape, round(airlight(picture, self.camera)), np.uint8)
        return cv2.blendLinear(picture[part], air, self._kept[part], self._lost[part])
