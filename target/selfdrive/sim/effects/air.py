"""Light on its way through air: attenuation and airlight.

Koschmieder's law: after a distance d through air of extinction b, a share exp(-b * d) of an object's light
remains; airlight, with the level of the horizon, replaces the rest. At the visibility distance, 5 % of the
contrast remains: b = -ln(0.05) / visibility (meteorological optical range, WMO No. 8).
"""

from math import cos, exp, log, sin

import cv2
import numpy as np

from selfdrive.common.array_math import each
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import Effect, Scene
from selfdrive.sim.picture import Picture, Region

VISIBILITY_CONTRAST = 0.05  # share that remains at the visibility distance (WMO No. 8)
LAYER_HEIGHT = 100.0  # m; above this height, the sky is clear


def extinction_coefficient(visibility: float) -> float:
    return -log(VISIBILITY_CONTRAST) / visibility


def light_path_lengths(camera: CameraModel) -> np.ndarray:
    """Path of each pixel's light (m) through the layer of air, from the road or from the layer's top.

    Float32 (rows, width); infinite at the horizon. The road is flat and empty.
    """
    right = (np.arange(camera.width) - camera.cx) / camera.fx
    down = ((np.arange(camera.rows) - camera.cy) / camera.fy)[:, None]
    fall = (sin(camera.pitch) + down * cos(camera.pitch)) / np.sqrt(1.0 + right**2 + down**2)
    with np.errstate(divide="ignore"):
        path = np.where(fall > 0.0, camera.height / fall, (LAYER_HEIGHT - camera.height) / np.abs(fall))
    return path.astype(np.float32)


def transmitted_share(coefficient: float, camera: CameraModel) -> np.ndarray:
    """Share of each pixel's light, float32, that air of this extinction coefficient (1/m) transmits."""
    return each(exp, np.float32(-coefficient) * light_path_lengths(camera)).astype(np.float32)


def airlight(picture: np.ndarray | Picture, camera: CameraModel) -> float:
    """Grey level of the air: the mean above the horizon, or of the top tenth of the rows if the horizon is
    higher."""
    rows = max(int(camera.horizon), camera.rows // 10)
    return cv2.mean(picture[:rows, :])[0]


def veil_picture(
    picture: np.ndarray, veil: np.ndarray, particle_shares: np.ndarray, air: float
) -> np.ndarray:
    """The picture after attenuation by a veil and by particles; `air` replaces the lost light.

    Arrays are uint8 of the same shape, shares in units of 1/255; `air` is a grey level.
    """
    transmitted = cv2.multiply(veil, cv2.bitwise_not(particle_shares), scale=1.0 / 255.0)
    airlight_part = cv2.convertScaleAbs(transmitted, alpha=-air / 255.0, beta=air)  # air * (1 - kept / 255)
    return cv2.add(cv2.multiply(picture, transmitted, scale=1.0 / 255.0), airlight_part)


class Fog(Effect):
    """Uniform fog of a given visibility."""

    UNIT, LEAST, MOST, MOVING = "m", 5.0, 20000.0, False

    def _prepare(self, random: np.random.Generator) -> None:
        self._transmitted = transmitted_share(extinction_coefficient(self.amount), self.camera)
        self._airlight_share = 1.0 - self._transmitted

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        part = region.part
        air = np.full(region.shape, round(airlight(picture, self.camera)), np.uint8)
        return cv2.blendLinear(picture[part], air, self._transmitted[part], self._airlight_share[part])
