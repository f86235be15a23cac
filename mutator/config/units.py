"""Units of numbers in YAML. A key ends in the unit's suffix (`offset_m`, `speed_mph`); the key `unit` has
suffix or symbol (`mps`, `m/s`), in manifests and specs alike.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """A unit: `suffix` in keys, `symbol` in tables, `factor` to SI (radians for angles)."""

    suffix: str
    symbol: str
    dimension: str
    si_factor: float


_RAD_PER_DEG = math.pi / 180

# Units only have factors. degC and K also differ by an offset, so they are not converted into each other.
UNITS = {
    suffix: Unit(suffix=suffix, symbol=symbol, dimension=dimension, si_factor=factor)
    for suffix, symbol, dimension, factor in (
        ("m", "m", "length", 1.0),
        ("mm", "mm", "length", 0.001),
        ("cm", "cm", "length", 0.01),
        ("km", "km", "length", 1000.0),
        ("per_m", "1/m", "curvature", 1.0),
        ("mps", "m/s", "speed", 1.0),
        ("kph", "km/h", "speed", 1 / 3.6),
        ("mph", "mph", "speed", 0.44704),
        ("mps2", "m/s^2", "acceleration", 1.0),
        ("rad", "rad", "angle", 1.0),
        ("deg", "deg", "angle", _RAD_PER_DEG),
        ("radps", "rad/s", "angular speed", 1.0),
        ("degps", "deg/s", "angular speed", _RAD_PER_DEG),
        ("radps2", "rad/s^2", "angular acceleration", 1.0),
        ("s", "s", "time", 1.0),
        ("ms", "ms", "time", 0.001),
        ("us", "us", "time", 1e-6),
        ("min", "min", "time", 60.0),
        ("hz", "Hz", "frequency", 1.0),
        ("kg", "kg", "mass", 1.0),
        ("n", "N", "force", 1.0),
        ("nm", "N m", "torque", 1.0),
        ("pa", "Pa", "pressure", 1.0),
        ("bar", "bar", "pressure", 1e5),
        ("w", "W", "power", 1.0),
        ("v", "V", "voltage", 1.0),
        ("a", "A", "current", 1.0),
        ("degc", "degC", "temperature in degrees Celsius", 1.0),
        ("k", "K", "temperature in kelvin", 1.0),
        ("mmph", "mm/h", "precipitation", 1.0),
        ("lx", "lx", "illuminance", 1.0),
        ("px", "px", "picture", 1.0),
        ("counts", "counts", "counts", 1.0),
        ("percent", "%", "share", 1.0),
    )
}
DIMENSIONLESS = "1"
_NO_UNIT = "-"
_UNIT_BY_SYMBOL = {unit.symbol: unit for unit in UNITS.values()}
UNIT_SUFFIXES_TEXT = ", ".join(UNITS)
_MOST_SUFFIX_PARTS = 1 + max(suffix.count("_") for suffix in UNITS)  # number of parts of the longest suffix


def split_key_at_unit(key: str) -> tuple[str, Unit | None]:
    """Split `offset_m` into (`offset`, metre), at the longest suffix. A key without a unit is returned with
    None.
    """
    for words in range(_MOST_SUFFIX_PARTS, 0, -1):  # the longest first: `per_m` ends in `m`, too
        stem, *parts = key.rsplit("_", words)
        suffix = "_".join(parts)
        if stem and suffix in UNITS:
            return stem, UNITS[suffix]
    return key, None


def suffix_of_unit(text: str) -> str | None:
    """Return the suffix of a unit given as suffix or symbol (`mps`, `m/s`), or `1` for none; None for an
    unknown unit.
    """
    if text in (DIMENSIONLESS, _NO_UNIT):
        return DIMENSIONLESS
    unit = UNITS.get(text) or _UNIT_BY_SYMBOL.get(text)
    return unit.suffix if unit else None


def symbol_of_unit(text: str) -> str:
    """Return the symbol of a unit given as suffix or symbol, and `-` for none. Other units, such as those of
    formulas, stay as they are.
    """
    suffix = suffix_of_unit(text)
    if suffix == DIMENSIONLESS:
        return _NO_UNIT
    return UNITS[suffix].symbol if suffix else text


def convert_unit(number: float, source: Unit, target: Unit) -> float:
    """Convert a number to another unit; ValueError if the dimensions differ."""
    if source.dimension != target.dimension:
        raise ValueError(f"{source.symbol} is not a unit of {target.dimension}")
    if source.si_factor == target.si_factor:  # dividing by the same factor could change the last digit
        return float(number)
    return number * source.si_factor / target.si_factor
