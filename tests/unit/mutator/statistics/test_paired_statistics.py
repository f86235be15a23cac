"""Statistics of paired runs."""

import math
from itertools import product

import numpy as np
import pandas as pd
import pytest

from mutator.statistics.paired_statistics import (
    PairCounts,
    PairedDifference,
    mcnemar_test,
    paired_times,
    rate_difference,
)


def flags(text: str) -> pd.Series:
    return pd.Series([letter == "1" for letter in text], dtype=bool)


def test_mcnemar_uses_the_pairs_that_differ() -> None:
    found = mcnemar_test(flags("1111111100"), flags("1000000010"))
    assert (found.both, found.first_only, found.second_only, found.neither, found.pair_count) == (
        1,
        7,
        1,
        1,
        10,
    )
    assert found.p_value == pytest.approx(2 * (1 + 8) / 2**8)


def test_equal_flags_have_a_p_value_of_one_and_no_interval() -> None:
    same = flags("1100")
    assert mcnemar_test(same, same) == PairCounts(both=2, first_only=0, second_only=0, neither=2, p_value=1.0)
    found = rate_difference(same, same, pd.Series(list("abcd")))
    assert found.difference == 0.0
    assert math.isnan(found.low) and math.isnan(found.high)


def test_whole_faults_are_resampled() -> None:
    """Ten equal pairs of each fault do not make the interval narrower."""
    first, second = flags("0" * 40), flags("1" * 10 + "0" * 30)
    alike = rate_difference(first, second, pd.Series([i // 10 for i in range(40)]))
    apart = rate_difference(first, second, pd.Series(range(40)))
    assert alike.difference == apart.difference == 0.25
    assert alike.high - alike.low > 1.5 * (apart.high - apart.low)
    assert rate_difference(first, second, pd.Series(range(40))) == apart  # the same result each time


def test_one_fault_has_no_interval() -> None:
    found = rate_difference(flags("00"), flags("10"), pd.Series(["a", "a"]))
    assert found.difference == 0.5
    assert math.isnan(found.low)


def test_median_times_use_pairs_with_both_times() -> None:
    first = pd.Series([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, None, 9.0])
    second = first + pd.Series([0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.1, 1.0, None])
    found = paired_times(first, second)
    assert (found.pair_count, found.first_median, found.second_median) == (7, 4.0, 4.8)
    assert found.median_difference == PairedDifference(difference=0.8, low=0.5, high=1.1)
    assert found.p_value == pytest.approx(2 / 2**7)


def test_equal_or_missing_times_have_no_result() -> None:
    same = pd.Series([1.0, 0.1 + 0.2])
    assert math.isnan(paired_times(same, pd.Series([1.0, 0.3])).p_value)
    none = paired_times(pd.Series([None], dtype=float), pd.Series([1.0]))
    assert none.pair_count == 0
    assert math.isnan(none.median_difference.difference)


@pytest.mark.parametrize("seed", range(3))
def test_the_interval_of_a_rate_equals_that_of_all_resamples(seed: int) -> None:
    """With five faults, all 5^5 resamples can be computed. The interval ends near their percentiles 2.5 and
    97.5."""
    draw = np.random.default_rng(seed)
    cluster = pd.Series(np.repeat(range(5), [1, 2, 3, 5, 8]))
    first, second = (pd.Series(draw.random(19) < chance) for chance in (0.3, 0.6))
    change = second.astype(int) - first.astype(int)
    totals = change.groupby(cluster).agg(["sum", "count"]).to_numpy()
    drawn = np.array([totals[list(picked)].sum(axis=0) for picked in product(range(5), repeat=5)])
    near = np.percentile(drawn[:, 0] / drawn[:, 1], [2.0, 3.0, 97.0, 98.0])
    found = rate_difference(first, second, cluster)
    assert near[0] <= found.low <= near[1] and near[2] <= found.high <= near[3]


@pytest.mark.parametrize("size", [5, 6, 9, 10, 30])
def test_the_median_difference_lies_between_order_statistics(size: int) -> None:
    """As in a sign test by hand, the interval drops as many differences at each end as 95 % coverage allows.
    With fewer than six differences, there is no interval."""
    change = pd.Series(np.random.default_rng(size).normal(0.3, 1.0, size))
    found = paired_times(pd.Series(np.zeros(size)), change).median_difference
    tails = [sum(math.comb(size, k) for k in range(i + 1)) / 2**size for i in range(size)]
    outside = [i for i, tail in enumerate(tails) if tail <= 0.025]
    if outside:
        ordered = sorted(change.round(9))
        assert (found.low, found.high) == (ordered[outside[-1]], ordered[-1 - outside[-1]])
    else:
        assert math.isnan(found.low) and math.isnan(found.high)


@pytest.mark.parametrize("size", [4, 7, 10])
def test_wilcoxon_is_exact_for_few_pairs(size: int) -> None:
    """The p-value is the share of all assignments of signs that are at least as extreme as the observed
    one."""
    change = pd.Series(np.random.default_rng(size).normal(0.5, 1.0, size))
    ranks = change.abs().rank()
    sums = [
        sum(r for r, up in zip(ranks, signs, strict=True) if up) for signs in product((0, 1), repeat=size)
    ]
    least = min(ranks[change > 0].sum(), ranks[change < 0].sum())
    expected = min(1.0, 2 * sum(total <= least for total in sums) / 2**size)
    assert paired_times(pd.Series(np.zeros(size)), change).p_value == pytest.approx(expected)


def test_weighted_pairs_count_as_often_as_their_weights_say() -> None:
    """Of four pairs, the second run of the first alone is worse; it stands for three, the others for one."""
    first, second = pd.Series([False] * 4), pd.Series([True, False, False, False])
    change = rate_difference(first, second, pd.Series(list("abcd")), pd.Series([3.0, 1.0, 1.0, 1.0]))
    assert change.difference == 0.5
    assert rate_difference(first, second, pd.Series(list("abcd"))).difference == 0.25
