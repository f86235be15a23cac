"""Statistics of pairs, each observed under a first and a second condition.

Runs of one fault are similar, so tests that treat pairs as independent overstate significance.
`rate_difference` resamples whole faults instead.
"""

import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL

if TYPE_CHECKING:
    import pandas as pd

RESAMPLE_COUNT = 9999  # a draw only adds up one number for each cluster
_RESAMPLING_SEED = 1  # fixed, so that resampling is deterministic
_TIME_DECIMALS = 9  # decimals of a time difference; absorbs rounding errors


@dataclass(frozen=True, slots=True, kw_only=True)
class PairCounts:
    """Numbers of pairs with the event under both conditions, only the first, only the second, or neither. `p`
    is from McNemar's exact test that the event is equally likely under both.
    """

    both: int
    first_only: int
    second_only: int
    neither: int
    p_value: float

    @property
    def pair_count(self) -> int:
        return self.both + self.first_only + self.second_only + self.neither


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedDifference:
    """The difference of a rate or time, second minus first, with its interval. NaN: not defined."""

    difference: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PairedTimes:
    """The times of `n` complete pairs in s: both medians, and the median difference (second minus first) with
    its exact interval. `p` is from Wilcoxon's test that the differences are symmetric about 0.
    """

    pair_count: int
    first_median: float
    second_median: float
    median_difference: PairedDifference
    p_value: float


def mcnemar_test(first: "pd.Series", second: "pd.Series") -> PairCounts:
    """Compare two flags of each pair with McNemar's exact test (statsmodels)."""
    from statsmodels.stats.contingency_tables import (  # type: ignore[import-untyped]
        mcnemar as exact_mcnemar,
    )

    both, neither = int((first & second).sum()), int((~first & ~second).sum())
    first_only, second_only = int((first & ~second).sum()), int((~first & second).sum())
    test = exact_mcnemar([[both, first_only], [second_only, neither]], exact=True)
    return PairCounts(
        both=both,
        first_only=first_only,
        second_only=second_only,
        neither=neither,
        p_value=min(1.0, float(test.pvalue)),
    )


def rate_difference(
    first: "pd.Series", second: "pd.Series", cluster: "pd.Series", weights: "pd.Series | None" = None
) -> PairedDifference:
    """Return the difference of a flag's rates, second minus first, with its `resampled_interval` over
    clusters. `weights` says how often each pair counts; None: once.
    """
    change = second.astype(int) - first.astype(int)
    counts = change * 0 + 1 if weights is None else weights
    sums = (change * counts).groupby(cluster.to_numpy()).sum().to_numpy()
    totals = counts.groupby(cluster.to_numpy()).sum().to_numpy()
    low, high = resampled_interval((sums, totals), _mean_change)
    difference = float((change * counts).sum() / counts.sum()) if len(change) else math.nan
    return PairedDifference(difference=difference, low=low, high=high)


def resampled_interval(clusters: Sequence[np.ndarray], statistic: Callable[..., Any]) -> tuple[float, float]:
    """Return the interval of a statistic from a percentile bootstrap over whole clusters (scipy).

    Each array has a number for each cluster. NaN if there are fewer than two clusters, if the statistic is
    undefined for some draws, or if it is equal for all draws, because unobserved clusters can differ.
    """
    from scipy.stats import DegenerateDataWarning, bootstrap  # type: ignore[import-untyped]

    if len(clusters[0]) < 2:
        return math.nan, math.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DegenerateDataWarning)  # then the result is NaN
        interval = bootstrap(
            clusters,
            statistic,
            paired=True,
            vectorized=True,
            n_resamples=RESAMPLE_COUNT,
            batch=500,  # limits memory, which grows with draws times clusters
            confidence_level=CONFIDENCE_LEVEL,
            method="percentile",
            rng=np.random.default_rng(_RESAMPLING_SEED),
        ).confidence_interval
    low, high = float(interval.low), float(interval.high)
    return (low, high) if low < high else (math.nan, math.nan)


def _mean_change(changes: Any, pairs: Any, axis: int = -1) -> Any:
    return np.sum(changes, axis=axis) / np.sum(pairs, axis=axis)


def paired_times(first: "pd.Series", second: "pd.Series") -> PairedTimes:
    """Compare the times of complete pairs (scipy): medians, the median difference with an exact interval from
    order statistics, and p of Wilcoxon's signed-rank test (NaN if no time differs).
    """
    from scipy.stats import quantile_test

    is_complete = first.notna() & second.notna()
    before, after = first[is_complete], second[is_complete]
    if before.empty:
        nan = math.nan
        return PairedTimes(
            pair_count=0,
            first_median=nan,
            second_median=nan,
            median_difference=PairedDifference(difference=nan, low=nan, high=nan),
            p_value=nan,
        )
    change = (after - before).round(_TIME_DECIMALS)
    interval = quantile_test(change.to_numpy(), p=0.5).confidence_interval(CONFIDENCE_LEVEL)
    return PairedTimes(
        pair_count=len(change),
        first_median=float(before.median()),
        second_median=float(after.median()),
        median_difference=PairedDifference(
            difference=float(change.median()), low=float(interval.low), high=float(interval.high)
        ),
        p_value=wilcoxon_p(before, after),
    )


def wilcoxon_p(first: "pd.Series", second: "pd.Series") -> float:
    """Return the p-value of Wilcoxon's signed-rank test on pairs without NaN; NaN if no pair differs."""
    from scipy.stats import wilcoxon as signed_rank

    change = (second - first).round(_TIME_DECIMALS)
    return float(signed_rank(change.to_numpy()).pvalue) if change.any() else math.nan
