"""Units in keys."""

import math

import pytest

from mutator.config import units


def test_a_key_gives_up_its_unit() -> None:
    """The suffix after the last underscore is the unit if it is one, else the key stays whole."""
    assert units.split("offset_m") == ("offset", units.UNITS["m"])
    assert units.split("per_step_kph") == ("per_step", units.UNITS["kph"])
    assert units.split("target") == ("target", None)
    assert units.split("nth_hit") == ("nth_hit", None)
    assert units.split("_m") == ("_m", None)


@pytest.mark.parametrize(
    ("number", "source", "target", "expected"),
    [
        (60, "mph", "mps", 26.8224),
        (36, "kph", "mps", 10.0),
        (10, "mps", "kph", 36.0),
        (180, "deg", "rad", math.pi),
        (300, "ms", "s", 0.3),
        (-35, "m", "m", -35.0),
    ],
)
def test_conversion(number: float, source: str, target: str, expected: float) -> None:
    """A quantity is the same in either unit, and exactly itself in its own."""
    result = units.convert(number, units.UNITS[source], units.UNITS[target])
    assert result == pytest.approx(expected, rel=1e-15)
    assert isinstance(result, float)


def test_dimensions_do_not_mix() -> None:
    """Metres are no speed."""
    with pytest.raises(ValueError, match="m is no unit of speed"):
        units.convert(1, units.UNITS["m"], units.UNITS["mps"])
