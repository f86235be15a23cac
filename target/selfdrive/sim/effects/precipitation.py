"""Rain and snow of a given rate, in mm of water an hour: single drops near the camera, a veil beyond.

Drops and flakes glow with the light of the sky, which they throw into the camera from all sides (K. Garg and
S. Nayar, 2007), so that they are seen before the road and vanish before the sky. Shutters are short in
daylight: streaks are of some pixels and faint, and the veil of all that is too small or too far to be seen
singly weighs as much.
"""

from abc import abstractmethod
from math import exp

import cv2
import numpy as np

from selfdrive.sim.effects.air import airlight, clearness, through_air
from selfdrive.sim.effects.effect import Effect, Scene
from selfdrive.sim.effects.particles import Particles, Streaks, cover

EXPOSURE = 0.001  # s, under a grey sky


class _Precipitation(Effect):
    """Particles whose numbers fall exponentially with their (melted) diameter.

    `REACHES` says up to which distance (m) particles from a diameter (mm) on are drawn one by one: where a
    particle would change a pixel by less than a grey level or two, it belongs to the veil.
    """

    UNIT = "mm/h"
    REACHES: tuple[tuple[float, float], ...]

    def _prepare(self, random: np.random.Generator) -> None:
        self._boxes = []
        limits = [least for least, _ in self.REACHES] + [self._largest()]
        for (least, reach), most in zip(self.REACHES, limits[1:], strict=True):
            melted = self._diameters(random, least, most, reach)
            size, speed = self._flown(melted)
            self._boxes.append(Particles(random, self.camera, reach, size, speed))
        self._veil = clearness(self._extinction(), self.camera)

    def _diameters(self, random: np.random.Generator, least: float, most: float, reach: float) -> np.ndarray:
        """Diameters (mm) from `least` to `most` of all particles in a box of this reach (m)."""
        number, slope = self._spectrum()
        box = reach**3 * self.camera.width / self.camera.fx * self.camera.rows / self.camera.fy
        few, many = exp(-slope * most), exp(-slope * least)
        count = round(box * number / slope * (many - few))
        return -np.log(few + (many - few) * random.uniform(size=count)) / slope

    def _affect(self, picture: np.ndarray, scene: Scene) -> np.ndarray:
        parts = [box.streaks(scene, EXPOSURE) for box in self._boxes]
        streaks = Streaks(
            np.concatenate([part.start for part in parts], axis=1),
            np.concatenate([part.end for part in parts], axis=1),
            np.concatenate([part.width for part in parts]),
        )
        kept = cv2.multiply(self._veil, cv2.subtract(1.0, cover(streaks, self.camera)))
        return through_air(picture, kept, airlight(picture, self.camera))

    @abstractmethod
    def _spectrum(self) -> tuple[float, float]:
        """N0 (per m^3 and mm) and slope (1/mm) of the numbers N0 * exp(-slope * diameter)."""

    @abstractmethod
    def _largest(self) -> float:
        """Largest diameter (mm)."""

    @abstractmethod
    def _flown(self, melted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Seen diameters (m) and speeds of fall (m/s)."""

    @abstractmethod
    def _extinction(self) -> float:
        """Extinction coefficient (1/m) of the air full of particles."""


class Rain(_Precipitation):
    """Rain: drops after Marshall and Palmer (1948), their speeds after Atlas and others (1973)."""

    LEAST, MOST = 0.5, 200.0
    REACHES = (1.0, 1.2), (2.0, 2.0), (3.0, 3.0)

    def _spectrum(self) -> tuple[float, float]:
        return 8000.0, 4.1 * self.amount**-0.21

    def _largest(self) -> float:
        return 6.0  # mm: larger ones break up

    def _flown(self, melted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0.001 * melted, 9.65 - 10.3 * np.exp(-0.6 * melted)

    def _extinction(self) -> float:
        # Attenuation of light by rain, as Halder and others (2019) use it for rendering.
        return 0.312e-3 * self.amount**0.67


class Snow(_Precipitation):
    """Dry snow: flakes after Gunn and Marshall (1958), their speeds after Langleben (1954).

    A flake is seen as large as its mass asks at a density falling with its size, 0.17 g/cm^3 at 1 mm
    (Holroyd, 1971).
    """

    LEAST, MOST = 0.1, 10.0
    REACHES = (1.0, 2.0), (2.0, 3.5), (3.0, 5.0)

    def _spectrum(self) -> tuple[float, float]:
        return 3800.0 * self.amount**-0.87, 2.55 * self.amount**-0.48

    def _largest(self) -> float:
        return 5.0  # mm of water

    def _flown(self, melted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return 0.001 * melted**1.5 / np.sqrt(0.17), 1.6 * (0.1 * melted) ** 0.3

    def _extinction(self) -> float:
        # Attenuation of light by dry snow, 5.5 dB/km at 1 mm/h (ITU-R P.1814).
        return 5.5e-3 * self.amount**1.38 * np.log(10.0) / 10.0
