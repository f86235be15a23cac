"""Compares guided with random triggers: stratified by fault type, on matched pairs, and resampled by fault.

Each fault (a value at a location) is tried in every context and scenario. Plain tests wrongly treat these
runs as independent, so `resampled_rate_difference` draws whole faults instead.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mutator.statistics.paired_statistics import PairCounts, resampled_interval
from mutator.statistics.paired_statistics import mcnemar_test as exact_mcnemar
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL
from mutator.statistics.tallies import Tally

if TYPE_CHECKING:
    import pandas as pd

RateBase = Literal["activated", "injected"]
RATE_BASES: tuple[RateBase, ...] = ("activated", "injected")
METHODS = GUIDED, RANDOM = "guided", "random"
_PAIR_KEY_COLUMNS = ["fault_id", "scenario", "row", "seed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultTypeStratum:
    fault_type: str
    guided_hazards: int
    guided_runs: int
    random_hazards: int
    random_runs: int

    @property
    def contingency_table(self) -> list[list[int]]:
        """The counts [hazard, no hazard], first of guided and then of random faults."""
        return [
            [self.guided_hazards, self.guided_runs - self.guided_hazards],
            [self.random_hazards, self.random_runs - self.random_hazards],
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class PooledOddsRatio:
    """The Mantel-Haenszel estimate over fault types: above 1 if guided faults are more hazardous, NaN if
    undefined.

    `p_of_odds_ratio_1` tests that the common odds ratio is 1, and `p_of_equal_odds_ratios` that
    the odds ratio is the same in all types.
    """

    odds_ratio: float
    low: float
    high: float
    p_of_odds_ratio_1: float
    p_of_equal_odds_ratios: float
    stratum_count: int  # fault types with runs of both methods


@dataclass(frozen=True, slots=True, kw_only=True)
class HazardRateDifference:
    """The hazard rate of guided runs minus that of random runs, with its bootstrap interval over
    `fault_count` faults.
    """

    difference: float
    low: float
    high: float
    fault_count: int


def strata_with_both_methods(
    counts: Mapping[tuple[str, str], Tally], base: RateBase
) -> tuple[FaultTypeStratum, ...]:
    """Return the fault types that have faults of both methods. `counts` has (method, fault type) as keys."""
    strata = []
    for kind in dict.fromkeys(kind for _, kind in counts):
        guided, random = counts.get((GUIDED, kind)), counts.get((RANDOM, kind))
        if guided and random and getattr(guided, base) and getattr(random, base):
            strata.append(
                FaultTypeStratum(
                    fault_type=kind,
                    guided_hazards=guided.hazards,
                    guided_runs=getattr(guided, base),
                    random_hazards=random.hazards,
                    random_runs=getattr(random, base),
                )
            )
    return tuple(strata)


def pool_odds_ratios(parts: Sequence[FaultTypeStratum]) -> PooledOddsRatio:
    """Compare the odds of a hazard in guided and random runs, stratified by fault type (statsmodels)."""
    informative = [
        s for s in parts if 0 < s.guided_hazards + s.random_hazards < s.guided_runs + s.random_runs
    ]
    if not informative:  # in each type all or none were hazards, so there are no odds to compare
        nan = math.nan
        return PooledOddsRatio(
            odds_ratio=nan,
            low=nan,
            high=nan,
            p_of_odds_ratio_1=nan,
            p_of_equal_odds_ratios=nan,
            stratum_count=len(parts),
        )
    from statsmodels.stats.contingency_tables import StratifiedTable  # type: ignore[import-untyped]

    table = StratifiedTable([np.array(stratum.contingency_table) for stratum in informative])
    with np.errstate(all="ignore"):  # an odds ratio of 0 or infinity has no finite interval
        low, high = table.oddsratio_pooled_confint(alpha=1 - CONFIDENCE_LEVEL)
        return PooledOddsRatio(
            odds_ratio=float(table.oddsratio_pooled),
            low=float(low),
            high=float(high),
            p_of_odds_ratio_1=float(table.test_null_odds(correction=False).pvalue),
            p_of_equal_odds_ratios=float(table.test_equal_odds().pvalue)
            if len(informative) > 1
            else math.nan,
            stratum_count=len(parts),
        )


def fisher_p(stratum: FaultTypeStratum) -> float:
    from scipy.stats import fisher_exact  # type: ignore[import-untyped]

    return float(fisher_exact(stratum.contingency_table).pvalue)


def holm_adjusted(p_values: Sequence[float]) -> tuple[float, ...]:
    """Adjust p-values by Holm's method (Scandinavian Journal of Statistics 6, 1979): the k-th smallest of n
    is multiplied by n - k + 1; results are monotone and at most 1. NaN stays NaN.
    """
    sorted_values = sorted((p, place) for place, p in enumerate(p_values) if not math.isnan(p))
    adjusted, largest = [math.nan] * len(p_values), 0.0
    for k, (p, place) in enumerate(sorted_values):
        adjusted[place] = largest = max(largest, min(1.0, p * (len(p_values) - k)))
    return tuple(adjusted)


def matched_pairs(frame: "pd.DataFrame") -> "pd.DataFrame":
    """Pair each guided run with the random run of the same fault, scenario, context row and seed.

    Columns end in `_guided` and `_random`. Runs without a partner (unfinished or failed) are left out.
    """
    columns = [*_PAIR_KEY_COLUMNS, "kind", "is_activated", "is_hazard"]
    guided, random = (frame.loc[frame["method"] == how, columns] for how in (GUIDED, RANDOM))
    # a run that occurs twice would count as several pairs
    return guided.merge(
        random.drop(columns="kind"),
        on=_PAIR_KEY_COLUMNS,
        suffixes=("_guided", "_random"),
        validate="one_to_one",
    )


def mcnemar_of_pairs(paired: "pd.DataFrame") -> PairCounts:
    return exact_mcnemar(paired["is_hazard_guided"], paired["is_hazard_random"])


def resampled_rate_difference(frame: "pd.DataFrame", base: RateBase) -> HazardRateDifference:
    data = _counts_by_fault(frame[frame["is_activated"]] if base == "activated" else frame)
    difference = float(_rate_difference(*data))
    low, high = (math.nan, math.nan) if math.isnan(difference) else resampled_interval(data, _rate_difference)
    return HazardRateDifference(difference=difference, low=low, high=high, fault_count=len(data[0]))


def _counts_by_fault(frame: "pd.DataFrame") -> tuple[Any, Any, Any, Any]:
    """Count for each fault: guided hazards, random hazards, guided runs, random runs (a sample: weighted)."""
    faults = sorted(frame["fault_id"].unique())
    guided, random = frame["method"] == GUIDED, frame["method"] == RANDOM
    hazard = frame["is_hazard"]
    weights = frame[WEIGHT_COLUMN] if WEIGHT_COLUMN in frame else (hazard | True).astype(int)
    a, b, c, d = (
        weights[rows].groupby(frame.loc[rows, "fault_id"]).sum().reindex(faults, fill_value=0).to_numpy()
        for rows in (guided & hazard, random & hazard, guided, random)
    )
    return a, b, c, d


def _rate_difference(
    guided_hazards: Any, random_hazards: Any, guided: Any, random: Any, axis: int = -1
) -> Any:
    """Return guided minus random hazards per run, over the faults on `axis`; NaN if a method has no run."""
    totals = [np.sum(x, axis=axis) for x in (guided_hazards, guided, random_hazards, random)]
    with np.errstate(invalid="ignore"):
        return totals[0] / totals[1] - totals[2] / totals[3]
