"""Units at the edge: a number in YAML carries its unit in its key (`offset_m`, `speed_mph`)."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """A unit: `suffix` as in keys, `symbol` as in tables, `factor` takes a number of it to SI (radians)."""

    suffix: str
    symbol: str
    dimension: str
    factor: float


UNITS = {
    unit.suffix: unit
    for unit in (
        Unit(suffix="m", symbol="m", dimension="length", factor=1.0),
        Unit(suffix="mps", symbol="m/s", dimension="speed", factor=1.0),
        Unit(suffix="kph", symbol="km/h", dimension="speed", factor=1 / 3.6),
        Unit(suffix="mph", symbol="mph", dimension="speed", factor=0.44704),
        Unit(suffix="mps2", symbol="m/s^2", dimension="acceleration", factor=1.0),
        Unit(suffix="rad", symbol="rad", dimension="angle", factor=1.0),
        Unit(suffix="deg", symbol="deg", dimension="angle", factor=math.pi / 180),
        Unit(suffix="s", symbol="s", dimension="time", factor=1.0),
        Unit(suffix="ms", symbol="ms", dimension="time", factor=0.001),
        Unit(suffix="mmph", symbol="mm/h", dimension="precipitation", factor=1.0),
        Unit(suffix="lx", symbol="lx", dimension="illuminance", factor=1.0),
        Unit(suffix="px", symbol="px", dimension="picture", factor=1.0),
    )
}
KNOWN = ", ".join(UNITS)


def split(key: str) -> tuple[str, Unit | None]:
    """`offset_m` -> (`offset`, metre); a key that ends in no unit is returned whole, with None."""
    stem, _, suffix = key.rpartition("_")
    return (stem, UNITS[suffix]) if stem and suffix in UNITS else (key, None)


def convert(number: float, source: Unit, target: Unit) -> float:
    """The same quantity in another unit of its dimension; ValueError when the dimensions differ."""
    if source.dimension != target.dimension:
        raise ValueError(f"{source.symbol} is no unit of {target.dimension}")
    if source.factor == target.factor:
        return float(number)
    return number * source.factor / target.factor
