"""Round numbers have few digits, and are multiples of a step where there is one."""

import pytest

from mutator.explore.round_numbers import RoundNumbers


def test_numbers_of_one_digit_are_1_2_and_5_of_each_power_of_ten() -> None:
    """Strictly between the ends, exactly as they are written."""
    assert RoundNumbers(least=0.1).between(0.1, 20.0, 1) == (0.2, 0.5, 1.0, 2.0, 5.0, 10.0)


def test_numbers_of_two_digits_include_those_of_one() -> None:
    """From 9.8 to 13, the distance grows from 0.1 to 1."""
    assert RoundNumbers(least=0.1).between(9.75, 13.0, 2) == (9.8, 9.9, 10.0, 11.0, 12.0)


@pytest.mark.parametrize("digits", [1, 2])
def test_multiples_of_a_step_are_at_least_one_step(digits: int) -> None:
    """A duration is a whole number of steps, none of them zero."""
    step = 1 / 30
    numbers = RoundNumbers(least=step, step=step).between(0.0, 2.0, digits)
    assert numbers
    assert all(
        round(number / step) >= 1 and abs(number / step % 1 - round(number / step % 1)) < 1e-6
        for number in numbers
    )
    assert list(numbers) == sorted(set(numbers))


def test_the_next_smaller_number_ends_at_the_least() -> None:
    """A stride beyond the least number gives the least; below it there is none."""
    numbers = RoundNumbers(least=1.0, step=1.0)
    assert numbers.below(187.0) == 180.0
    assert numbers.below(12.0) == 11.0
    assert numbers.below(5.0, 3) == 2.0
    assert numbers.below(5.0, 30) == 1.0
    assert numbers.below(1.0) is None


@pytest.mark.parametrize(
    ("number", "expected"), [(0.051, 0.06), (0.05, 0.05), (3.57, 3.6), (0.001, 0.01), (99.1, 100.0)]
)
def test_a_number_is_rounded_up_to_two_digits(number: float, expected: float) -> None:
    """A duration that follows from another one stays long enough."""
    assert RoundNumbers(least=0.01, step=0.01).at_least(number) == expected
