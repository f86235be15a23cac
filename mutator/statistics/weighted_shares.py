"""Shares of runs: of a whole campaign, or of a sample, whose runs are weighted."""

import math
from typing import TYPE_CHECKING

import numpy as np

from mutator.statistics.bootstrap_median_intervals import draw_cluster_counts
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.shares_with_intervals import (
    CONFIDENCE_LEVEL,
    Share,
    share_with_interval,
    wilson_interval,
)

if TYPE_CHECKING:
    import pandas as pd


def share_of_runs(frame: "pd.DataFrame", part: "pd.Series", whole: "pd.Series") -> Share:
    """Return the share of the runs in `whole` that are also in `part`, flags for each row of `frame`.

    Without weights, the interval is Wilson's. With weights, it comes from resampling whole faults; if all
    draws agree, because few faults were drawn or none has the property, it is Wilson's for as many runs as
    the weights are worth (L. Kish, 1965). NaN if a weight is NaN.
    """
    is_in_whole = whole.to_numpy(dtype=bool)
    is_in_both = is_in_whole & part.to_numpy(dtype=bool)
    count, of = int(is_in_both.sum()), int(is_in_whole.sum())
    if WEIGHT_COLUMN not in frame or not of:
        return share_with_interval(count, of)
    weights = frame[WEIGHT_COLUMN].to_numpy(dtype=float)[is_in_whole]
    if np.isnan(weights).any():
        return Share(count=count, of=of, low=math.nan, high=math.nan, weighted_rate=math.nan)
    flags, faults = is_in_both[is_in_whole], frame["fault_id"][is_in_whole]
    rate = float(weights[flags].sum() / weights.sum())
    low, high = _resampled_interval(weights, flags, faults)
    if math.isnan(low):
        low, high = wilson_interval(rate, float(weights.sum() ** 2 / (weights**2).sum()))
    return Share(count=count, of=of, low=low, high=high, weighted_rate=rate)


def _resampled_interval(weights: np.ndarray, flags: np.ndarray, faults: "pd.Series") -> tuple[float, float]:
    """Return the interval of the weighted share from draws of whole faults; NaN if they agree."""
    import pandas as pd

    codes, names = pd.factorize(faults)
    if len(names) < 2 or flags.all() or not flags.any():
        return math.nan, math.nan
    parts = np.bincount(codes, weights * flags, len(names))
    wholes = np.bincount(codes, weights, len(names))
    draws = np.concatenate(
        [(counts @ parts) / (counts @ wholes) for counts in draw_cluster_counts(len(names), 1)]
    )
    tail = (1 - CONFIDENCE_LEVEL) / 2
    low, high = (float(end) for end in np.quantile(draws, (tail, 1 - tail)))
    return (low, high) if low < high else (math.nan, math.nan)
