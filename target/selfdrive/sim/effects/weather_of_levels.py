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
from selfdrive.sim.effects.degradation import FAR, NEAR
from selfdrive.sim.effects.paper_weather import BLOCKS, REACH, STREAKS
from selfdrive.sim.effects.precipitation import Rain, Snow

LEFT = 0.05  # share of the contrast that remains at the meteorological range
DROP = 1.0  # mm; smaller drops make no streak
BLOCK = 2.0  # px; smaller flakes make no block
SIZES, HALVINGS = 200, 40


class Weather(NamedTuple):
    rate: float  # mm of water per hour; 0 for none
    range: float  # m, meteorological range


def rain(thickness: float, camera: CameraModel) -> Weather:
    def drops(rate: float) -> float:
        fall = Rain(rate, 0, camera)
        return fall.density(DROP, fall.largest()) * _volume(REACH, camera)

    rate = _where(drops, STREAKS * thickness, Rain.LEAST, Rain.MOST)
    return Weather(rate, _range(Rain(rate, 0, camera).extinction()))


def snow(thickness: float, camera: CameraModel) -> Weather:
    def flakes(rate: float) -> float:
        fall = Snow(rate, 0, camera)
        ends = np.linspace(0.0, fall.largest(), SIZES + 1)
        seen, _ = fall.flown(0.5 * (ends[:-1] + ends[1:]))  # m
        reach = [camera.fy * size / BLOCK for size in seen.tolist()]
        sizes = zip(ends[:-1].tolist(), ends[1:].tolist(), reach, strict=True)
        return total([fall.density(least, most) * _volume(far, camera) for least, most, far in sizes])

    rate = _where(flakes, BLOCKS * thickness, Snow.LEAST, Snow.MOST)
    return Weather(rate, _range(Snow(rate, 0, camera).extinction()))


def fog(contrast: float) -> Weather:
    """The fog in which this share of the contrast remains in the middle of the measured road."""
    return Weather(0.0, _range(-log(contrast) / (0.5 * (NEAR + FAR))))


def _volume(reach: float, camera: CameraModel) -> float:
    across = camera.width / camera.fx * camera.rows / camera.fy
    return across * reach**3 / 3.0


def _range(extinction: float) -> float:
    return -log(LEFT) / extinction


def _where(count: Callable[[float], float], wanted: float, least: float, most: float) -> float:
    for _ in range(HALVINGS):
        middle = 0.5 * (least + most)
        least, most = (middle, most) if count(middle) < wanted else (least, middle)
    return 0.5 * (least + most)
