"""Medians with intervals from the bootstrap: whole faults are drawn anew, with all that their runs say.

Each draw takes as many faults as there are, some of them several times; the interval has the middle 95 % of
the medians of the draws. Seeded, so the same results give the same interval.
"""

import math
from collections.abc import Iterator

import numpy as np
import pandas as pd

from mutator.statistics.paired import Difference
from mutator.statistics.shares import CONFIDENCE

RESAMPLES = 999
_SEED = 1
_CELLS = 500_000  # of one batch of draws, runs times draws: bounds the memory


def median_interval(values: pd.Series, cluster: pd.Series) -> tuple[float, float]:
    """The interval of the median of `values`, none of them NaN; `cluster` says whose each is.

    NaN for fewer than two clusters, and where all values are the same: that no other was seen does not mean
    that there is none.
    """
    return _interval([values.to_numpy(dtype=float)], cluster)


def median_difference(first: pd.Series, second: pd.Series, cluster: pd.Series) -> Difference:
    """The median of pairs the second time less that the first; a draw of the interval keeps the pairs
    together. NaN of none, and intervals as of `median_interval`."""
    before, after = first.to_numpy(dtype=float), second.to_numpy(dtype=float)
    if not before.size:
        return Difference(difference=math.nan, low=math.nan, high=math.nan)
    low, high = _interval([after, before], cluster)
    return Difference(difference=float(np.median(after) - np.median(before)), low=low, high=high)


def _interval(samples: list[np.ndarray], cluster: pd.Series) -> tuple[float, float]:
    """The interval of the first sample's median, less the second's if there is one."""
    codes, names = pd.factorize(cluster)
    alike = np.ptp(samples[0] if len(samples) == 1 else samples[0] - samples[1]) == 0 if codes.size else True
    if len(names) < 2 or alike:
        return math.nan, math.nan
    orders = [np.argsort(sample, kind="stable") for sample in samples]
    found = []
    for counts in _draws(len(names), codes.size):
        medians = [_medians(s[o], counts[:, codes[o]]) for s, o in zip(samples, orders, strict=True)]
        found.append(medians[0] - medians[1] if len(medians) > 1 else medians[0])
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(np.concatenate(found), (tail, 1 - tail))
    return float(low), float(high)


def _draws(clusters: int, runs: int) -> Iterator[np.ndarray]:
    """How often each cluster is drawn: (draws, clusters), in batches."""
    rng = np.random.default_rng(_SEED)
    batch = max(1, _CELLS // runs)
    for begin in range(0, RESAMPLES, batch):
        size = min(batch, RESAMPLES - begin)
        yield rng.multinomial(clusters, np.full(clusters, 1 / clusters), size=size).astype(np.int32)


def _medians(values: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The median of each draw of sorted values, of which it has each so many times: (draws, values)."""
    until = np.cumsum(counts, axis=1, dtype=np.int32)
    whole = until[:, -1:]
    lower, upper = ((until <= place).sum(axis=1) for place in ((whole - 1) // 2, whole // 2))
    medians: np.ndarray = (values[lower] + values[upper]) / 2
    return medians
