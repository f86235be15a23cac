"""Arithmetic in a fixed order is as exact as NumPy's."""

import math

import numpy as np
import pytest
from selfdrive.common import array_math
from selfdrive.common.ordered import total

RANDOM = np.random.default_rng(4)


def test_products_equal_numpys_matrix_products() -> None:
    a, b = RANDOM.normal(size=(3, 5)), RANDOM.normal(size=(5, 2))
    assert array_math.product(a, b) == pytest.approx(a @ b, rel=1e-13)
    assert array_math.dot(a[0], b[:, 1]) == pytest.approx(a[0] @ b[:, 1], rel=1e-13)
    assert isinstance(array_math.dot(a[0], b[:, 1]), float)


def test_length_keeps_the_summed_axis() -> None:
    vectors = np.array([[3.0, 4.0], [5.0, 12.0]])
    assert array_math.vector_lengths(vectors).tolist() == [[5.0], [13.0]]


def test_each_calls_the_function_for_one_value_at_a_time() -> None:
    values = np.array([[1.0, 2.0], [3.0, 4.0]], np.float32)
    asked = []
    found = array_math.each(lambda value: asked.append(value) or -value, values)
    assert found.dtype == np.float64
    assert found.tolist() == [[-1.0, -2.0], [-3.0, -4.0]]
    assert asked == [1.0, 2.0, 3.0, 4.0]
    assert {type(value) for value in asked} == {float}
    assert array_math.each(math.exp, np.empty((0, 3))).shape == (0, 3)


@pytest.mark.parametrize(("kind", "digits"), [(np.float64, 4e-16), (np.float32, 3e-7)])
def test_logarithm_is_exact_to_the_last_digits(kind: type, digits: float) -> None:
    powers = np.ldexp(RANDOM.uniform(0.5, 1.0, 2000), RANDOM.integers(-90, 90, 2000))
    values = np.concatenate((powers, np.linspace(0.6, 1.6, 101))).astype(kind)
    found = array_math.natural_log(values)
    assert found.dtype == np.float64
    true = np.array([math.log(value) for value in values.tolist()])
    assert np.abs(found - true).max() <= digits * np.abs(true).max()
    assert array_math.natural_log(np.ones(1, kind)).tolist() == [0.0]


def test_totals_are_added_from_left_to_right() -> None:
    """Since Python 3.12, `sum` rounds differently."""
    assert total([1e16, 1.0, -1e16]) == 0.0
    assert total(iter([0.1] * 10)) == 0.9999999999999999
    assert total([]) == 0
