"""Texts with holes, `the sensor reads {value} too low`, and the numbers that fill them."""

import re
from collections.abc import Mapping, Sequence

PhraseTexts = tuple[str, ...]  # the first one whose holes all have values is used
VALUE_HOLE, ABSOLUTE_PREFIX = "value", "abs_"
CHANGED_HOLE, FUNCTION_HOLE, FILE_HOLE = "changed", "function", "file"  # in phrases of fault models

_HOLE_PATTERN = re.compile(r"\{([^{}]*)\}")
_LEAST_SHOWN_AS_WHOLE_NUMBER = 100.0  # from here on, converted numbers have no decimals
_LEAST_WITH_HUNDREDTHS = 0.1
_WHOLE_FROM = 1000.0  # rounded numbers of this size have four digits without a fraction
_ROUNDING = 1e-9  # numbers below this are 0
_LARGEST_EXACT = 1e15


def holes_of(text: str) -> list[str]:
    return _HOLE_PATTERN.findall(text)


def has_single_brace(text: str) -> bool:
    return bool(set("{}") & set(_HOLE_PATTERN.sub("", text)))


def fill_phrase(texts: Sequence[str], values: Mapping[str, str]) -> str:
    """Return the first text whose holes all have a value, filled in; '' if there is none."""
    for text in texts:
        if all(values.get(name) for name in holes_of(text)):
            return _HOLE_PATTERN.sub(lambda hole: values[hole[1]], text)
    return ""


def measured_number_text(number: float, unit: str = "") -> str:
    """Return a measured number as sentences, lists and tables all show it: `24.60 m/s`; one below 0.1 with
    two digits.
    """
    size = number if abs(number) >= _ROUNDING else 0.0
    text = f"{size:.2f}" if abs(size) >= _LEAST_WITH_HUNDREDTHS else f"{size:.2g}"
    return with_unit(text, unit)


def converted_number_text(number: float, unit: str = "") -> str:
    """Return a number in another unit than the plan's, as one says it: `124 m`, `24.6 kph`, `0.46 m`."""
    size = abs(number)
    if size >= _LEAST_SHOWN_AS_WHOLE_NUMBER:
        text = f"{number:.0f}"
    elif size >= 1.0:
        text = f"{number:.1f}".removesuffix(".0")
    else:
        text = f"{number if size >= _ROUNDING else 0.0:.2g}"
    return with_unit(text, unit)


def measured_time_text(seconds: float) -> str:
    """Return a time in a drive as tables show it: `24.60 s`; a shorter one than 0.1 s with two digits."""
    return measured_number_text(seconds, "s")


def planned_number_text(number: float, unit: str = "") -> str:
    """Return a number of the plan with all its digits: `50 mph`."""
    text = str(int(number)) if float(number).is_integer() and abs(number) < _LARGEST_EXACT else repr(number)
    return with_unit(text, unit)


def rounded_number_text(number: float) -> str:
    """Return a number with four digits, `2.076` for 2.0760537599999997; from 1000 on, as a whole number."""
    return planned_number_text(float(f"{number:.0f}" if abs(number) >= _WHOLE_FROM else f"{number:.4g}"))


def with_unit(text: str, unit: str) -> str:
    return text if unit in ("", "-") else f"{text} {unit}"
