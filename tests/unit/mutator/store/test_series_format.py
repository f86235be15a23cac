"""The bytes of a stored series."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mutator.errors import MutatorError
from mutator.store.series_format import ExtraPoints, Series, decode_series, encode_series

T = np.arange(6) / 20
WORDS = arrays("<u4", (3, 6), elements=st.integers(0, 2**32 - 1))


def series(values: np.ndarray, points: ExtraPoints | None = None) -> Series:
    """Series in which the last channel has a value at every second time only."""
    rows = [*values[:-1], values[-1, ::2].copy()]
    every = [1] * (len(values) - 1) + [2]
    return Series(
        t=T[: values.shape[1]],
        channel_values=rows,
        sample_every=every,
        facts={"end": 1.0},
        extra_points=points or ExtraPoints(),
    )


def bits(one: Series) -> list[list[int]]:
    return [row.view("<u4").tolist() for row in one.channel_values]


@settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])  # no test measures time
@given(WORDS, WORDS, st.integers(1, 6))
def test_all_values_round_trip_bit_for_bit(one: np.ndarray, other: np.ndarray, count: int) -> None:
    golden = series(one.view("<f4"))
    faulty = series(np.ascontiguousarray(other[:, :count]).view("<f4"))
    back = decode_series(encode_series(golden))
    assert bits(back) == bits(golden)
    found = decode_series(encode_series(faulty, golden), back)
    assert bits(found) == bits(faulty)
    assert found.t.tolist() == T[:count].tolist()
    assert found.facts == {"end": 1.0}


def test_values_equal_to_the_golden_run_take_no_space() -> None:
    values = np.random.default_rng(1).random((20, 600)).astype("<f4")
    golden = Series(t=np.arange(600) / 20, channel_values=list(values), sample_every=[1] * 20, facts={})
    assert len(encode_series(golden, golden)) < 100


def test_points_round_trip() -> None:
    single = np.array([np.inf], dtype="<f4")
    points = ExtraPoints(
        channel_numbers=np.array([2]), t=np.array([0.013]), golden_values=single, faulty_values=-single
    )
    values = np.zeros((3, 6), dtype="<f4")
    found = decode_series(encode_series(series(values, points), series(values)), series(values)).extra_points
    assert (found.channel_numbers.tolist(), found.t.tolist()) == ([2], [0.013])
    assert (found.golden_values.tolist(), found.faulty_values.tolist()) == ([np.inf], [-np.inf])


@pytest.mark.parametrize("place", [0, 15, -12, -1])
def test_a_changed_byte_is_an_error(place: int) -> None:
    data = bytearray(encode_series(series(np.ones((3, 6), dtype="<f4"))))
    data[place] ^= 0xFF
    with pytest.raises(MutatorError, match="damaged"):
        decode_series(bytes(data))
    with pytest.raises(MutatorError, match="damaged"):
        decode_series(bytes(data[:-20]))
