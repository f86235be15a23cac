"""Too much light and too little: low sun ahead, and dusk on a small sensor."""

from math import acos, cos, exp, log, pi, radians, sin, sqrt

import cv2
import numpy as np

from selfdrive.common.array_math import each, vector_lengths
from selfdrive.common.camera_model import CameraModel
from selfdrive.sim.effects.effect import WHITE, Effect, Scene
from selfdrive.sim.picture import Picture, Region

WHITE_REFLECTANCE = 0.32  # reflectance shown as white in daylight; asphalt of 0.12 has level 95
SUN_HEIGHT_RANGE = radians(6.0), radians(12.0)  # drawn from this range
MOST_SUN_SIDE_ANGLE = radians(8.0)  # at most, to either side
SUN_RADIUS = radians(0.27)  # as seen from the earth
ASPHALT_SLOPE_RMS = 0.25  # rms slope of surface facets
NORMAL_REFLECTANCE = 0.04  # reflectance at normal incidence, for a refractive index of 1.5
MIRRORING_SHARE = 0.004  # share of a dry road's surface that mirrors; similar to the CIE's road table R3

ELECTRONS_PER_LUX = 14.0  # freed in a pixel by white light of 1 lux in the longest exposure (10 ms)
FULL_WELL_ELECTRONS = 10000.0  # the most that a pixel holds, white in good light
MOST_GAIN = 64.0  # 36 dB
READ_NOISE_ELECTRONS = 5.0  # electrons
NOISE_QUANTILE_COUNT = 256  # of a pixel's noise, as many as grey levels


class SunGlare(Effect):
    """The low sun ahead: light scattered in lens and windscreen, and mirrored by the road.

    The amount is the scattering of the glass, as a multiple of Stiles and Holladay's law for glare, 10 *
    illuminance / angle^2 (cd/m^2, lux, degrees). The light of sun and sky follows the Illuminating
    Engineering Society's clear sky. The sun's position is drawn from the seed.
    """

    UNIT, LEAST, MOST, MOVING = "times a clear eye", 0.0, 10.0, False

    def _prepare(self, random: np.random.Generator) -> None:
        height = random.uniform(*SUN_HEIGHT_RANGE)
        side = random.uniform(-MOST_SUN_SIDE_ANGLE, MOST_SUN_SIDE_ANGLE)
        sun = np.array([sin(side) * cos(height), -sin(height), cos(side) * cos(height)])
        rays = pixel_rays(self.camera)
        beam = 127500.0 * exp(-0.21 / sin(height))  # lux, across the beam
        ground = beam * sin(height) + 800.0 + 15500.0 * sqrt(sin(height))  # lux, on the road
        white = WHITE_REFLECTANCE * ground / pi  # cd/m^2
        angle = each(acos, np.clip((rays * sun).sum(axis=-1), -1.0, 1.0))
        luminance = self.amount * 10.0 * beam / np.degrees(np.maximum(angle, SUN_RADIUS)) ** 2
        luminance += mirrored_sun_luminance(rays, sun) * beam
        light = WHITE * luminance / white + 2.0 * WHITE * (angle < SUN_RADIUS)
        self._light = np.clip(np.rint(light), 0, WHITE).astype(np.uint8)

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        return cv2.add(picture[region.part], self._light[region.part])


def pixel_rays(camera: CameraModel) -> np.ndarray:
    """Direction of each pixel's ray (rows, width, 3): right, down and ahead of a level car."""
    right = np.broadcast_to((np.arange(camera.width) - camera.cx) / camera.fx, (camera.rows, camera.width))
    low = np.broadcast_to(((np.arange(camera.rows) - camera.cy) / camera.fy)[:, None], right.shape)
    down = low * cos(camera.pitch) + sin(camera.pitch)
    ahead = cos(camera.pitch) - low * sin(camera.pitch)
    rays = np.stack([right, down, ahead], axis=-1)
    return rays / vector_lengths(rays)


def mirrored_sun_luminance(rays: np.ndarray, sun: np.ndarray) -> np.ndarray:
    """Luminance (cd/m^2) of the sun's reflection in rough asphalt per lux of its beam.

    Facets with Beckmann's distribution of slopes, Fresnel reflectance after Schlick; 0 above the horizon.
    """
    down = np.maximum(rays[..., 1], 0.02)
    half = sun - rays
    half /= vector_lengths(half)
    across = np.clip((half * sun).sum(axis=-1), 0.0, 1.0)
    upright = np.maximum(-half[..., 1], 1e-3)
    slope = (1.0 / upright**2 - 1.0) / ASPHALT_SLOPE_RMS**2
    facets = each(exp, -slope) / (pi * ASPHALT_SLOPE_RMS**2 * (upright * upright) ** 2)
    mirror = NORMAL_REFLECTANCE + (1.0 - NORMAL_REFLECTANCE) * (1.0 - across) * ((1.0 - across) ** 2) ** 2
    # Rough surfaces shadow themselves at grazing angles of view or light.
    shadow = np.minimum(1.0, 2.0 * upright * np.minimum(down, -sun[1]) / np.maximum(across, 1e-3))
    return np.where(rays[..., 1] > 0.0, MIRRORING_SHARE * mirror * facets * shadow / (4.0 * down), 0.0)


class LowLight(Effect):
    """Little light on the road, in lux: long exposure, then gain, then darkness, and the sensor's noise.

    Each pixel's electrons have a Poisson distribution (shot noise); reading adds Gaussian noise. Noise
    differs between pictures but is the same for the same moment.
    """

    UNIT, LEAST, MOST = "lux", 0.05, 100000.0

    def _prepare(self, random: np.random.Generator) -> None:
        white = min(FULL_WELL_ELECTRONS, ELECTRONS_PER_LUX * self.amount)
        electrons_of_white = max(white, FULL_WELL_ELECTRONS / MOST_GAIN)  # electrons for white
        self._level_table = np.stack(
            [_noisy_levels(white * level / WHITE, electrons_of_white) for level in range(WHITE + 1)]
        ).ravel()
        rows, columns = self.camera.rows, self.camera.width
        self._noise_quantiles = random.integers(
            0, NOISE_QUANTILE_COUNT, size=(2 * rows, 2 * columns), dtype=np.uint16
        )

    def _affect(self, picture: np.ndarray | Picture, region: Region, scene: Scene) -> np.ndarray:
        random = np.random.Generator(np.random.PCG64([self.seed, round(1000.0 * abs(scene.t))]))
        rows, columns = picture.shape
        noise_row, noise_column = random.integers(0, (rows, columns))
        index = picture[region.part].astype(np.intp)
        index *= NOISE_QUANTILE_COUNT
        index += self._noise_quantiles[
            noise_row + region.top : noise_row + region.bottom,
            noise_column + region.left : noise_column + region.right,
        ]
        return np.take(self._level_table, index)


def _noisy_levels(electrons: float, electrons_of_white: float) -> np.ndarray:
    """Grey levels (uint8) of a pixel with this mean number of electrons, one per quantile of its noise."""
    reach = 8.0 * sqrt(electrons) + 10.0
    numbers = np.arange(max(0, int(electrons - reach)), int(electrons + reach))
    # Poisson probabilities by the ratio of neighbours, relative to the first.
    steps = each(log, max(electrons, 1e-9) / np.maximum(numbers[1:], 1))
    chance = np.concatenate([[0.0], np.cumsum(steps)])
    chance = each(exp, chance - chance.max())
    reach = int(6.0 * READ_NOISE_ELECTRONS)
    reading = each(exp, -0.5 * (np.arange(-reach, reach + 1) / READ_NOISE_ELECTRONS) ** 2)
    summed = np.cumsum(_convolve(chance, reading))
    counts = np.arange(summed.size) + 0.5 + numbers[0] - reach
    share = (np.arange(NOISE_QUANTILE_COUNT) + 0.5) / NOISE_QUANTILE_COUNT
    values = np.interp(share, summed / summed[-1], counts)
    return np.clip(np.rint(WHITE * values / electrons_of_white), 0, WHITE).astype(np.uint8)


def _convolve(chances: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    summed = np.zeros(chances.size + kernel.size - 1)
    for k, share in enumerate(kernel.tolist()):
        summed[k : k + chances.size] += share * chances
    return summed
