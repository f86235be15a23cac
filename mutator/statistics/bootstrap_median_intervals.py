"""Medians with bootstrap intervals that resample whole faults with all their runs.

Each draw takes as many faults as there are, with replacement. The interval covers the middle 95 % of the
medians of all draws. The seed is fixed.
"""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from mutator.statistics.paired_statistics import PairedDifference
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL

if TYPE_CHECKING:
    import pandas as pd

RESAMPLE_COUNT = 999  # fewer than for rates, because each draw of a median goes through all runs
_RESAMPLING_SEED = 1  # fixed, so that equal results give equal tables
_MOST_BATCH_CELLS = 500_000  # maximum number of cells in one batch of draws, to limit memory
_MIN_BLOCK_SIZE = 256  # minimum number of values in a block, if there are as many


def median_interval(values: "pd.Series", cluster: "pd.Series") -> tuple[float, float]:
    """Return the interval of the median of `values`, which must not contain NaN. `cluster` has the cluster of
    each value.

    NaN if there are fewer than two clusters or if all values are equal, because unobserved values can differ.
    """
    return _bootstrap_interval([values.to_numpy(dtype=float)], cluster)


def median_difference(first: "pd.Series", second: "pd.Series", cluster: "pd.Series") -> PairedDifference:
    """Return the median of the second values minus that of the first, with its interval; draws keep pairs
    together. NaN without pairs. The interval is NaN in the same cases as in `median_interval`.
    """
    before, after = first.to_numpy(dtype=float), second.to_numpy(dtype=float)
    if not before.size:
        return PairedDifference(difference=math.nan, low=math.nan, high=math.nan)
    low, high = _bootstrap_interval([after, before], cluster)
    return PairedDifference(difference=float(np.median(after) - np.median(before)), low=low, high=high)


def _bootstrap_interval(samples: list[np.ndarray], cluster: "pd.Series") -> tuple[float, float]:
    """Return the interval of the median of the first sample, minus that of the second if there is one."""
    import pandas as pd

    codes, names = pd.factorize(cluster)
    is_constant = (
        np.ptp(samples[0] if len(samples) == 1 else samples[0] - samples[1]) == 0 if codes.size else True
    )
    if len(names) < 2 or is_constant:
        return math.nan, math.nan
    block = _block_size(len(names), codes.size)
    sorted_samples = [_SortedBlocks(sample, codes, len(names), block) for sample in samples]
    draws = []
    for counts in draw_cluster_counts(len(names), max(codes.size // block + 1, block)):
        medians = [sample.medians(counts) for sample in sorted_samples]
        draws.append(medians[0] - medians[1] if len(medians) > 1 else medians[0])
    tail = (1 - CONFIDENCE_LEVEL) / 2
    low, high = np.quantile(np.concatenate(draws), (tail, 1 - tail))
    return float(low), float(high)


def _block_size(clusters: int, runs: int) -> int:
    """Return the number of values per block. It balances two costs: a product for each block and cluster, and
    work on each value in the median's block, which is about 50 times as slow.
    """
    return min(runs, max(_MIN_BLOCK_SIZE, math.isqrt(clusters * runs // 50)))


def draw_cluster_counts(cluster_count: int, other_cells_per_draw: int) -> Iterator[np.ndarray]:
    """Yield batches of shape (draws, clusters): how often each cluster is drawn. Each draw also needs memory
    for `others` cells.
    """
    rng = np.random.default_rng(_RESAMPLING_SEED)
    batch = max(1, _MOST_BATCH_CELLS // max(cluster_count, other_cells_per_draw))
    for begin in range(0, RESAMPLE_COUNT, batch):
        size = min(batch, RESAMPLE_COUNT - begin)
        yield rng.multinomial(cluster_count, np.full(cluster_count, 1 / cluster_count), size=size)


class _SortedBlocks:
    """Sorted values in blocks, with the number of each cluster's values in each block. The median of a draw
    is located first by block, then within the block.
    """

    def __init__(self, values: np.ndarray, codes: np.ndarray, clusters: int, block: int) -> None:
        self._block_size = block
        order = np.argsort(values, kind="stable")
        self._values, self._codes = values[order], codes[order]
        blocks = -(-values.size // block)
        cells = np.arange(values.size) // block * clusters + self._codes
        self._count_by_block_and_cluster = (
            np.bincount(cells, minlength=blocks * clusters).reshape(blocks, clusters).astype(float)
        )

    def medians(self, counts: np.ndarray) -> np.ndarray:
        """Return the median of each draw. `counts`, of shape (draws, clusters), says how often each cluster
        is drawn.
        """
        until = np.cumsum(
            counts @ self._count_by_block_and_cluster.T, axis=1
        )  # integers, which floats represent exactly
        whole = until[:, -1:].astype(np.int64)
        lower, upper = (self._values_of_rank(rank, until, counts) for rank in ((whole - 1) // 2, whole // 2))
        medians: np.ndarray = (lower + upper) / 2
        return medians

    def _values_of_rank(self, rank: np.ndarray, until: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """For each draw, the value with the index `rank` among its sorted values."""
        block = (until <= rank).sum(axis=1)
        before = np.take_along_axis(until, np.maximum(block - 1, 0)[:, None], axis=1)[:, 0]
        indices = np.minimum(
            block[:, None] * self._block_size + np.arange(self._block_size), self._values.size - 1
        )
        inside = np.cumsum(np.take_along_axis(counts, self._codes[indices], axis=1), axis=1)
        within = (inside + np.where(block > 0, before, 0)[:, None] <= rank).sum(axis=1)
        values: np.ndarray = self._values[block * self._block_size + within]
        return values
