"""Weather, dirt and light between the road and the camera's picture; only faults import this package.

There are three presets: the paper's effects with its parameters (PaperRain and others), the same effects
as its authors coded them (CodedRain and others), and physical ones in real units (Fog and others).
"""

from selfdrive.sim.effects.air import Fog
from selfdrive.sim.effects.as_coded import CodedFog, CodedOcclusion, CodedRain, CodedSnow
from selfdrive.sim.effects.lens import LensMud, PaperOcclusion
from selfdrive.sim.effects.light import LowLight, SunGlare
from selfdrive.sim.effects.paper_weather import PaperFog, PaperRain, PaperSnow
from selfdrive.sim.effects.precipitation import Rain, Snow
from selfdrive.sim.effects.tone import AveragingBlur, Brightness, Contrast, GaussianBlur, MedianBlur

__all__ = [
    "AveragingBlur",
    "Brightness",
    "CodedFog",
    "CodedOcclusion",
    "CodedRain",
    "CodedSnow",
    "Contrast",
    "Fog",
    "GaussianBlur",
    "LensMud",
    "LowLight",
    "MedianBlur",
    "PaperFog",
    "PaperOcclusion",
    "PaperRain",
    "PaperSnow",
    "Rain",
    "Snow",
    "SunGlare",
]
