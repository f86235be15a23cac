"""How well the order of fault types by hazards agrees with the published one."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mutator.paper.published_numbers import PublishedNumbers
from mutator.statistics.paired_statistics import resampled_interval
from mutator.statistics.tallies import tally_by_fault_type

if TYPE_CHECKING:
    import pandas as pd

GUIDED = "guided"


@dataclass(frozen=True, slots=True, kw_only=True)
class RankAgreement:
    """Spearman's rank correlation between hazards / activated here and in the publication, by fault type.

    Ties have their mean rank. `low` and `high` are the 95 % interval of a percentile bootstrap over fault
    types; NaN if undefined. `tied_here` and `tied_there` count the fault types that share their value.
    """

    correlation: float
    low: float
    high: float
    fault_types: int
    tied_here: int
    tied_there: int


def measure_agreement(frame: "pd.DataFrame", published: PublishedNumbers) -> RankAgreement:
    """Compare guided experiments. Fault types that never activated, here or there, are left out."""
    tallies, pairs = tally_by_fault_type(frame), []
    for key, printed in published.tally_by_fault_type.items():
        if key[0] == GUIDED and key in tallies and tallies[key].activated and printed.activated:
            pairs.append((tallies[key].hazards / tallies[key].activated, printed.hazards / printed.activated))
    here, there = (np.array(values) for values in zip(*pairs, strict=True))
    low, high = resampled_interval((here, there), rank_correlation)
    return RankAgreement(
        correlation=float(rank_correlation(here, there)),
        low=low,
        high=high,
        fault_types=len(pairs),
        tied_here=_count_tied(here),
        tied_there=_count_tied(there),
    )


def rank_correlation(first: Any, second: Any, axis: int = -1) -> Any:
    """Spearman's rank correlation along an axis; NaN if all values of a side are equal."""
    from scipy.stats import rankdata  # type: ignore[import-untyped]

    ranks = [rankdata(values, axis=axis) for values in (first, second)]
    x, y = (rank - rank.mean(axis=axis, keepdims=True) for rank in ranks)
    with np.errstate(invalid="ignore"):
        return (x * y).sum(axis) / np.sqrt((x * x).sum(axis) * (y * y).sum(axis))


def _count_tied(values: np.ndarray) -> int:
    counts = np.unique(values, return_counts=True)[1]
    return int(counts[counts > 1].sum())
