"""Measures for published observations: numbers computed from a frame of results, each with an interval.

`runs` comes from `mutator.statistics.results_frame.load_usable_results`. `of`, `part` and `against` are
pandas queries on it; an empty query selects all runs. Reports show the call for each claim, which you can
repeat in Python:

    from mutator.paper.measures import *
    from mutator.statistics.results_frame import load_usable_results
    runs = load_usable_results(Path("results.csv"))
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from mutator._common.message_text import counted
from mutator.statistics import event_times, guided_against_random
from mutator.statistics.shares import CONFIDENCE, Share
from mutator.statistics.shares import share as wilson
from mutator.statistics.tallies import tally_by_fault_type

__all__ = [
    "Path",
    "clustered_difference",
    "difference",
    "mean_time",
    "median_time",
    "paired",
    "share",
    "stratified",
]


_BOUNDS_A_MEDIAN = 6  # with fewer runs, all lie on one side of the true median in more than 5 % of cases


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """An estimate with its 95 % interval (NaN: none). `text` shows everything."""

    estimate: float
    low: float
    high: float
    n: int  # runs or pairs
    count: int | None = None  # those with the property, if they can be counted
    text: str

    def __str__(self) -> str:
        return self.text


def share(runs: pd.DataFrame, *, of: str, part: str) -> Estimate:
    """Return the share of runs in `of` that are also in `part`, with Wilson's interval."""
    return of_share(_share(runs, of, part))


def difference(runs: pd.DataFrame, *, of: str, against: str, part: str) -> Estimate:
    """Return the share of `part` in `of` minus that in `against`, with Newcombe's interval."""
    return of_difference(_share(runs, of, part), _share(runs, against, part))


def clustered_difference(runs: pd.DataFrame, *, of: str) -> Estimate:
    """Return the hazard rate of guided runs minus that of random runs.

    The interval resamples whole faults (location and value).
    """
    chosen = _query(runs, of)
    one, other = (
        _share(chosen, f'method == "{how}"', "is_hazard")
        for how in (guided_against_random.GUIDED, guided_against_random.RANDOM)
    )
    found = guided_against_random.resampled_rate_difference(
        chosen,
        "injected",  # `chosen` has only the runs to count
    )
    faults = counted(found.fault_count, "fault")
    return Estimate(
        estimate=found.difference,
        low=found.low,
        high=found.high,
        n=min(one.of, other.of),
        text=_against(found.difference, found.low, found.high, one, other, f", {faults}"),
    )


def stratified(runs: pd.DataFrame, *, of: str) -> Estimate:
    """Return the odds ratio of a hazard, guided against random, over all fault types (Mantel-Haenszel)."""
    parts = guided_against_random.strata_with_both_methods(tally_by_fault_type(_query(runs, of)), "injected")
    found = guided_against_random.mantel_haenszel(parts)
    types = counted(found.strata, "fault type")
    said = f"- ({types})"
    if not math.isnan(found.odds_ratio):
        said = (
            f"odds ratio {found.odds_ratio:.3g} ({found.low:.3g} to {found.high:.3g}; {types}; "
            f"p {found.p:.2g}, equal in all types: p {found.p_equal:.2g})"
        )
    return Estimate(
        estimate=found.odds_ratio,
        low=found.low,
        high=found.high,
        n=min(sum(s.guided for s in parts), sum(s.random for s in parts)),
        text=said,
    )


def paired(runs: pd.DataFrame, *, of: str) -> Estimate:
    """Of the pairs in which only one run has a hazard, return the share in which it is the guided run.

    The Clopper-Pearson interval agrees with McNemar's exact test. `of` is a query on pairs, with column names
    that end in `_guided` and `_random`.
    """
    from statsmodels.stats.proportion import proportion_confint  # type: ignore[import-untyped]

    matched = guided_against_random.mcnemar_of_pairs(_query(guided_against_random.matched_pairs(runs), of))
    unlike = matched.first_only + matched.second_only
    low = high = estimate = math.nan
    if unlike:
        estimate = matched.first_only / unlike
        low, high = map(float, proportion_confint(matched.first_only, unlike, 1 - CONFIDENCE, "beta"))
    return Estimate(
        estimate=estimate,
        low=low,
        high=high,
        n=unlike,
        count=matched.first_only,
        text=f"{counted(matched.pair_count, 'pair')}; hazard only in the guided run: {matched.first_only}, "
        f"only in the random run: {matched.second_only} (McNemar p {matched.p:.2g})",
    )


def mean_time(runs: pd.DataFrame, *, of: str, start: str, end: str) -> Estimate:
    """Return the mean of `end - start` in s over the runs in `of` that have both (Student's t interval)."""
    from scipy.stats import ttest_1samp  # type: ignore[import-untyped]

    chosen = _query(runs, of)
    known = (chosen[end] - chosen[start]).dropna()
    if len(known) < 2 or known.nunique() < 2:  # a single value says nothing about the spread
        return Estimate(
            estimate=math.nan, low=math.nan, high=math.nan, n=len(known), text=f"- (N {len(known)})"
        )
    interval = ttest_1samp(known, 0.0).confidence_interval(CONFIDENCE)
    return _seconds(float(known.mean()), float(interval.low), float(interval.high), len(known))


def median_time(runs: pd.DataFrame, *, of: str) -> Estimate:
    """Return the Kaplan-Meier median of the time (s) from the first alert to a hazard.

    Times are censored at the end of the run (column `t_end`, simulated seconds). The median is infinite if
    most alerts are not followed by a hazard.
    """
    chosen = _query(runs, of)
    if chosen["t_end"].isna().any():
        nan = math.nan
        return Estimate(estimate=nan, low=nan, high=nan, n=0, text="- (the ends of the runs are not known)")
    ends = {str(scenario): float(group["t_end"].iloc[0]) for scenario, group in chosen.groupby("scenario")}
    found = event_times.reaction_times(chosen, ends, 0.0)
    median, low, high = found.median, found.median_low, found.median_high
    if found.runs_alerted_first and math.isnan(low):  # the curve stays above one half or jumps past it
        median = math.inf if math.isnan(median) else median
        if found.runs_alerted_first >= _BOUNDS_A_MEDIAN:
            low = high = median
    return _seconds(median, low, high, found.runs_alerted_first)


def of_share(one: Share) -> Estimate:
    return Estimate(estimate=one.rate, low=one.low, high=one.high, n=one.of, count=one.count, text=str(one))


def of_difference(one: Share, other: Share) -> Estimate:
    """Return the first share minus the second, for separate sets of runs (Newcombe, statsmodels)."""
    from statsmodels.stats.proportion import confint_proportions_2indep

    low = high = math.nan
    if one.of and other.of:
        low, high = confint_proportions_2indep(
            one.count, one.of, other.count, other.of, method="newcomb", compare="diff", alpha=1 - CONFIDENCE
        )
    gap = one.rate - other.rate
    said = _against(gap, low, high, one, other)
    return Estimate(estimate=gap, low=float(low), high=float(high), n=min(one.of, other.of), text=said)


def _query(runs: pd.DataFrame, text: str) -> pd.DataFrame:
    return runs.query(text, engine="python") if text else runs


def _share(runs: pd.DataFrame, of: str, part: str) -> Share:
    words = {*re.findall(r"\w+", f"{of} {part}")}  # selecting rows is slow with all columns
    chosen = _query(runs[[name for name in runs.columns if name in words]], of)
    return wilson(len(_query(chosen, part)), len(chosen))


def _against(gap: float, low: float, high: float, one: Share, other: Share, more: str = "") -> str:
    both = f"{_plain(one)} against {_plain(other)}"
    if math.isnan(gap):
        return both
    return f"{100 * gap:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f}{more}): {both}"


def _plain(one: Share) -> str:
    return f"{100 * one.rate:.1f} % ({one.count}/{one.of})" if one.of else "- (0/0)"


def _seconds(value: float, low: float, high: float, n: int) -> Estimate:
    interval = "" if math.isnan(low) else f"; {low:.2f} to {high:.2f}"
    said = f"{value:.2f} s (N {n}{interval})" if n else "- (N 0)"
    return Estimate(estimate=value, low=low, high=high, n=n, text=said)


MEASURES = {
    f.__name__: f
    for f in (share, difference, clustered_difference, stratified, paired, mean_time, median_time)
}
