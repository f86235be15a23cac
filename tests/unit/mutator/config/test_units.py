"""Units as suffixes of YAML keys."""

import math
import re
from pathlib import Path

import pytest

from mutator.config import units

CLONE = Path(__file__).parents[4]


def test_the_longest_suffix_of_a_key_is_its_unit() -> None:
    assert units.split_key_at_unit("offset_m") == ("offset", units.UNITS["m"])
    assert units.split_key_at_unit("per_step_kph") == ("per_step", units.UNITS["kph"])
    assert units.split_key_at_unit("by_per_m") == ("by", units.UNITS["per_m"])
    assert units.split_key_at_unit("per_m") == ("per", units.UNITS["m"])
    assert units.split_key_at_unit("torque_nm") == ("torque", units.UNITS["nm"])
    assert units.split_key_at_unit("target") == ("target", None)
    assert units.split_key_at_unit("nth_hit") == ("nth_hit", None)
    assert units.split_key_at_unit("_m") == ("_m", None)


@pytest.mark.parametrize(
    ("number", "source", "target", "expected"),
    [
        (60, "mph", "mps", 26.8224),
        (36, "kph", "mps", 10.0),
        (10, "mps", "kph", 36.0),
        (180, "deg", "rad", math.pi),
        (300, "ms", "s", 0.3),
        (-35, "m", "m", -35.0),
        (250, "mm", "m", 0.25),
        (12, "cm", "mm", 120.0),
        (1.5, "km", "m", 1500.0),
        (90, "degps", "radps", math.pi / 2),
        (250, "us", "ms", 0.25),
        (2, "min", "s", 120.0),
        (1.2, "bar", "pa", 120000.0),
        (20, "degc", "degc", 20.0),
    ],
)
def test_values_are_converted_between_units(number: float, source: str, target: str, expected: float) -> None:
    result = units.convert_unit(number, units.UNITS[source], units.UNITS[target])
    assert result == pytest.approx(expected, rel=1e-15)
    assert isinstance(result, float)


def test_units_of_different_dimensions_cannot_be_converted() -> None:
    with pytest.raises(ValueError, match="m is not a unit of speed"):
        units.convert_unit(1, units.UNITS["m"], units.UNITS["mps"])
    with pytest.raises(ValueError, match="degC is not a unit of temperature in kelvin"):
        units.convert_unit(20, units.UNITS["degc"], units.UNITS["k"])


def test_every_unit_is_recognized_as_a_suffix() -> None:
    assert {suffix: units.split_key_at_unit(f"by_{suffix}") for suffix in units.UNITS} == {
        suffix: ("by", unit) for suffix, unit in units.UNITS.items()
    }
    assert len({unit.symbol for unit in units.UNITS.values()}) == len(units.UNITS)


def test_the_shipped_library_uses_only_expected_units() -> None:
    first = {"m", "mps", "kph", "mph", "mps2", "rad", "deg", "s", "ms", "mmph", "lx", "px"}
    for path in (*CLONE.glob("fault_library/faults/**/*.yaml"), *CLONE.glob("templates/*.yaml")):
        for key in re.findall(r"[{ ]([a-z][a-z0-9_]*):", path.read_text()):
            unit = units.split_key_at_unit(key)[1]
            assert unit is None or unit.suffix in first, f"{path}: {key}"


@pytest.mark.parametrize(
    ("text", "suffix", "symbol"),
    [
        ("mps", "mps", "m/s"),
        ("m/s", "mps", "m/s"),
        ("%", "percent", "%"),
        ("1", "1", "-"),
        ("-", "1", "-"),
        ("m/s^3", None, "m/s^3"),
    ],
)
def test_manifests_and_specs_have_one_vocabulary_of_units(text: str, suffix: str | None, symbol: str) -> None:
    """Suffix and symbol are the same unit; what has no suffix is a unit of tables only."""
    assert units.suffix_of_unit(text) == suffix
    assert units.symbol_of_unit(text) == symbol
