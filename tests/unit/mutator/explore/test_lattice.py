"""The lattice of an exploration."""

from itertools import pairwise

from mutator.explore.lattice import durations_between, magnitudes_between


def test_magnitudes_have_equal_ratios_and_few_digits() -> None:
    """Neighbours differ by the same factor, up to rounding to three digits; the ends are exact."""
    magnitudes = magnitudes_between(0.6, 60.0, 51)
    assert len(magnitudes) == 51 and magnitudes[0] == 0.6 and magnitudes[-1] == 60.0
    assert all(1.08 < b / a < 1.12 for a, b in pairwise(magnitudes))
    assert all(float(f"{value:.3g}") == value for value in magnitudes)


def test_ends_have_no_noise_of_conversions() -> None:
    """A sweep's last range can end at 2.5000000000000004."""
    assert magnitudes_between(0.025000000000000005, 2.5000000000000004, 3) == (0.025, 0.25, 2.5)


def test_durations_are_whole_steps_and_differ() -> None:
    """Short ones, which would be the same number of steps, are there once."""
    durations = durations_between(0.01, 15.0, 51, 0.01)
    assert durations[:4] == (0.01, 0.02, 0.03, 0.04) and durations[-1] == 15.0
    assert all(a < b and round(b / 0.01) == round(b / 0.01, 6) for a, b in pairwise(durations))


def test_one_value_is_a_lattice() -> None:
    """A range that is a point, and a request for one point, give the last value."""
    assert magnitudes_between(5.0, 5.0, 51) == (5.0,)
    assert durations_between(0.01, 2.0, 1, 0.01) == (2.0,)
