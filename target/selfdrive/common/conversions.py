"""Factors between SI and display units. Multiply: `speed_mps * MS_TO_KPH`."""

from math import pi

MS_TO_KPH = 3.6
KPH_TO_MS = 1.0 / 3.6
MPH_TO_MS = 0.44704
DEG_TO_RAD = pi / 180.0
RAD_TO_DEG = 180.0 / pi
