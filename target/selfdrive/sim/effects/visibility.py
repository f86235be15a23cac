"""The weather that each level of the paper's rain, fog, snow and occlusion represents.

The text gives numbers of streaks, blocks and blobs, and contrasts, but not how bad the weather is. Here, the
weather follows from the numbers of drops and flakes in front of the camera:

* rain: a streak is a drop of at least 1 mm within `REACH`, at the rate with that many drops (J. Marshall and
  W. Palmer, 1948);
* snow: a block of two pixels is a flake that looks at least as large, likewise (K. Gunn and J. Marshall,
  1958; E. Holroyd, 1971);
* fog: a contrast is what is left in the middle of the measured road, after H. Koschmieder (1924), where 5 %
  is left at the meteorological range;
* the range in rain and snow follows from their extinction (S. Halder and others, 2019; ITU-R P.1814).
"""

from collections.abc import Callable
from math import log
from typing import NamedTuple

import numpy as np

from selfdrive.common.camera_model import CameraModel
from selfdrive.common.ordered import total
from selfdrive.sim.effects.paper_weather import BLOCKS, REACH, STREAKS
from selfdrive.sim.effects.precipitation import Rain, Snow
from selfdrive.sim.effects.severity import FAR, NEAR

LEFT = 0.05  # of the contrast, at the meteorological range
DROP = 1.0  # mm; smaller drops make no streak
BLOCK = 2.0  # px; smaller flakes make no block
SIZES, HALVINGS = 200, 40


class Weather(NamedTuple):
    """The weather that a level represents."""

    rate: float  # mm of water per hour; 0 for none
    range: float  # m, meteorological range


def rain(thickness: float, camera: CameraModel) -> Weather:
    """The rain with that number of drops near the camera."""

    def drops(rate: float) -> float:
        fall = Rain(rate, 0, camera)
        return fall.density(DROP, fall.largest()) * _volume(REACH, camera)

    rate = _where(drops, STREAKS * thickness, Rain.LEAST, Rain.MOST)
    return Weather(rate, _range(Rain(rate, 0, camera).extinction()))


def snow(thickness: float, camera: CameraModel) -> Weather:
    """The snowfall with that number of flakes as large as a block."""

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
    """The fog in which this share of the contrast is left in the middle of the measured road."""
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
