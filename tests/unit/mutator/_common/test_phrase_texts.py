"""Texts with holes, and numbers in them."""

import pytest

from mutator._common.phrase_texts import (
    converted_number_text,
    fill_phrase,
    measured_number_text,
    measured_time_text,
    planned_number_text,
    rounded_number_text,
)


@pytest.mark.parametrize(
    ("number", "text"),
    [(123.7, "124 s"), (24.63, "24.6 s"), (37.02, "37 s"), (0.4567, "0.46 s"), (1e-12, "0 s")],
)  # fmt: skip
def test_a_converted_number_is_rounded_as_one_says_it(number: float, text: str) -> None:
    assert converted_number_text(number, "s") == text


@pytest.mark.parametrize(
    ("number", "text"),
    [(123.7, "123.70 m"), (1.4452, "1.45 m"), (-1.4452, "-1.45 m"), (0.0467, "0.047 m"), (1e-12, "0 m")],
)
def test_a_measured_number_has_the_hundredths_of_tables(number: float, text: str) -> None:
    """A margin of -1.445 m in a list and an excursion of 1.445 m in a sentence are one number."""
    assert measured_number_text(number, "m") == text


@pytest.mark.parametrize(
    ("number", "text"), [(50, "50 mph"), (8.0, "8 mph"), (-12.34, "-12.34 mph"), (1e20, "1e+20 mph")]
)
def test_a_planned_number_has_all_its_digits(number: float, text: str) -> None:
    assert planned_number_text(number, "mph") == text


def test_a_number_without_a_unit_stands_alone() -> None:
    """`-` is a unit that means none."""
    assert (measured_number_text(2.0), planned_number_text(2.0, "-")) == ("2.00", "2")


def test_the_first_text_whose_holes_have_values_is_used() -> None:
    """A text with an empty or missing hole is skipped; without any text there is none."""
    texts = ("at {speed}, {later}", "{later}")
    assert fill_phrase(texts, {"speed": "3 m/s", "later": "now"}) == "at 3 m/s, now"
    assert fill_phrase(texts, {"speed": "", "later": "now"}) == "now"
    assert fill_phrase(texts, {}) == ""


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (0.03, "0.03 s"),
        (0.5, "0.50 s"),
        (24.6, "24.60 s"),
        (129.91, "129.91 s"),
        (0.002, "0.002 s"),
    ],
)
def test_a_time_has_the_hundredths_of_tables(seconds: float, text: str) -> None:
    assert measured_time_text(seconds) == text


def test_a_rounded_number_has_four_digits_or_no_fraction() -> None:
    numbers = (-2.0760537599999997, 57.29577951308232, 12345.678, 100.0, 0.05, float("inf"))
    assert [*map(rounded_number_text, numbers)] == ["-2.076", "57.3", "12346", "100", "0.05", "inf"]
