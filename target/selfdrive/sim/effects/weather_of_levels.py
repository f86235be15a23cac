"""The weather that each level of the paper's rain, fog, snow and occlusion represents.

docs/reference/image-effects.md explains how the weather follows from the paper's numbers. Sources: rain, J.
Marshall and W. Palmer (1948); snow, K. Gunn and J. Marshall (1958), E. Holroyd (1971); fog, H. Koschmieder
(1924); extinction of rain and snow, S. Halder and others (2019), ITU-R P.1814.
"""

from collections.abc import Callable
from math import log
from typing import NamedTuple

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.ordered import total
from selfdrive.sim.effects.degradation import MEASURED_FROM, MEASURED_TO
from selfdrive.sim.effects.paper_weather import BLOCKS, REACH, STREAKS
from selfdrive.sim.effects.precipitation import Rain, Snow

REMAINING_CONTRAST = 0.05  # share of the contrast that remains at the meteorological range
MIN_STREAK_DROP = 1.0  # mm; smaller drops make no streak
MIN_BLOCK_SIZE = 2.0  # px; smaller flakes make no block
SIZE_CLASSES, BISECTIONS = 200, 40  # of flakes; of the rate, which leave 1e-12 of its range


class Weather(NamedTuple):
    rate: float  # mm of water per hour; 0 for none
    visible_range: float  # m, meteorological range


def rain_of_level(thickness: float, camera: CameraModel) -> Weather:
    def drops(rate: float) -> float:
        fall = Rain(rate, 0, camera)
        return fall.particle_density(MIN_STREAK_DROP, fall.largest_diameter()) * _view_volume(REACH, camera)

    rate = _solve_rate(drops, STREAKS * thickness, Rain.LEAST, Rain.MOST)
    return Weather(rate, _meteorological_range(Rain(rate, 0, camera).extinction_coefficient()))


def snow_of_level(thickness: float, camera: CameraModel) -> Weather:
    def flakes(rate: float) -> float:
        fall = Snow(rate, 0, camera)
        ends = np.linspace(0.0, fall.largest_diameter(), SIZE_CLASSES + 1)
        visible_sizes, _ = fall.sizes_and_speeds(0.5 * (ends[:-1] + ends[1:]))  # m
        reach = [camera.fy * size / MIN_BLOCK_SIZE for size in visible_sizes.tolist()]
        sizes = zip(ends[:-1].tolist(), ends[1:].tolist(), reach, strict=True)
        return total(
            [fall.particle_density(least, most) * _view_volume(far, camera) for least, most, far in sizes]
        )

    rate = _solve_rate(flakes, BLOCKS * thickness, Snow.LEAST, Snow.MOST)
    return Weather(rate, _meteorological_range(Snow(rate, 0, camera).extinction_coefficient()))


def fog_of_contrast(contrast: float) -> Weather:
    """The fog in which this share of the contrast remains in the middle of the measured road."""
    return Weather(0.0, _meteorological_range(-log(contrast) / (0.5 * (MEASURED_FROM + MEASURED_TO))))


def _view_volume(reach: float, camera: CameraModel) -> float:
    across = camera.width / camera.fx * camera.rows / camera.fy
    return across * reach**3 / 3.0


def _meteorological_range(extinction: float) -> float:
    return -log(REMAINING_CONTRAST) / extinction


def _solve_rate(count: Callable[[float], float], expected_count: float, least: float, most: float) -> float:
    for _ in range(BISECTIONS):
        middle = 0.5 * (least + most)
        least, most = (middle, most) if count(middle) < expected_count else (least, middle)
    return 0.5 * (least + most)
