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
from typing import TYPE_CHECKING

from mutator._common.message_text import counted
from mutator.statistics import event_time_statistics, guided_against_random
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL, Share
from mutator.statistics.tallies import tally_by_fault_type
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd

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


_MIN_RUNS_TO_BOUND_MEDIAN = (
    6  # with fewer runs, all lie on one side of the true median in more than 5 % of cases
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """An estimate with its 95 % interval (NaN: none). `text` shows everything."""

    value: float
    low: float
    high: float
    n: int  # runs or pairs
    count_with_property: int | None = None  # those with the property, if they can be counted
    text: str

    def __str__(self) -> str:
        return self.text


def share(runs: "pd.DataFrame", *, of: str, part: str) -> Estimate:
    """Return the share of runs in `of` that are also in `part`, with its interval; of a sample, weighted."""
    return estimate_of_share(_measure_share(runs, of, part))


def difference(runs: "pd.DataFrame", *, of: str, against: str, part: str) -> Estimate:
    """Return the share of `part` in `of` minus that in `against`, with Newcombe's interval."""
    return estimate_of_difference(_measure_share(runs, of, part), _measure_share(runs, against, part))


def clustered_difference(runs: "pd.DataFrame", *, of: str) -> Estimate:
    """Return the hazard rate of guided runs minus that of random runs.

    The interval resamples whole faults (location and value).
    """
    selected_runs = _select_runs(runs, of)
    guided_share, random_share = (
        _measure_share(selected_runs, f'method == "{method}"', "is_hazard")
        for method in (guided_against_random.GUIDED, guided_against_random.RANDOM)
    )
    interval = guided_against_random.resampled_rate_difference(
        selected_runs,
        "injected",  # the selected runs are only those to count
    )
    faults = counted(interval.fault_count, "fault")
    return Estimate(
        value=interval.difference,
        low=interval.low,
        high=interval.high,
        n=min(guided_share.of, random_share.of),
        text=_describe_difference(
            interval.difference, interval.low, interval.high, guided_share, random_share, f", {faults}"
        ),
    )


def stratified(runs: "pd.DataFrame", *, of: str) -> Estimate:
    """Return the odds ratio of a hazard, guided against random, over all fault types (Mantel-Haenszel)."""
    strata = guided_against_random.strata_with_both_methods(
        tally_by_fault_type(_select_runs(runs, of)), "injected"
    )
    ratio = guided_against_random.pool_odds_ratios(strata)
    types = counted(ratio.stratum_count, "fault type")
    text = f"- ({types})"
    if not math.isnan(ratio.odds_ratio):
        is_tested = not math.isnan(ratio.p_of_equal_odds_ratios)
        equal = f"p {ratio.p_of_equal_odds_ratios:.2g}" if is_tested else "not tested"
        text = (
            f"odds ratio {ratio.odds_ratio:.3g} ({ratio.low:.3g} to {ratio.high:.3g}; {types}; "
            f"p {ratio.p_of_odds_ratio_1:.2g}, equal in all types: {equal})"
        )
    return Estimate(
        value=ratio.odds_ratio,
        low=ratio.low,
        high=ratio.high,
        n=min(sum(s.guided_runs for s in strata), sum(s.random_runs for s in strata)),
        text=text,
    )


def paired(runs: "pd.DataFrame", *, of: str) -> Estimate:
    """Of the pairs in which only one run has a hazard, return the share in which it is the guided run.

    The Clopper-Pearson interval agrees with McNemar's exact test. `of` is a query on pairs, with column names
    that end in `_guided` and `_random`.
    """
    from statsmodels.stats.proportion import proportion_confint  # type: ignore[import-untyped]

    matched = guided_against_random.mcnemar_of_pairs(
        _select_runs(guided_against_random.matched_pairs(runs), of)
    )
    discordant = matched.first_only + matched.second_only
    low = high = estimate = math.nan
    if discordant:
        estimate = matched.first_only / discordant
        low, high = map(
            float, proportion_confint(matched.first_only, discordant, 1 - CONFIDENCE_LEVEL, "beta")
        )
    return Estimate(
        value=estimate,
        low=low,
        high=high,
        n=discordant,
        count_with_property=matched.first_only,
        text=f"{counted(matched.pair_count, 'pair')}; hazard only in the guided run: {matched.first_only}, "
        f"only in the random run: {matched.second_only} (McNemar p {matched.p_value:.2g})",
    )


def mean_time(runs: "pd.DataFrame", *, of: str, start: str, end: str) -> Estimate:
    """Return the mean of `end - start` in s over the runs in `of` that have both (Student's t interval)."""
    from scipy.stats import ttest_1samp  # type: ignore[import-untyped]

    selected_runs = _select_runs(runs, of)
    times_s = (selected_runs[end] - selected_runs[start]).dropna()
    if len(times_s) < 2 or times_s.nunique() < 2:  # a single value says nothing about the spread
        return Estimate(
            value=math.nan, low=math.nan, high=math.nan, n=len(times_s), text=f"- (N {len(times_s)})"
        )
    interval = ttest_1samp(times_s, 0.0).confidence_interval(CONFIDENCE_LEVEL)
    return _time_estimate(float(times_s.mean()), float(interval.low), float(interval.high), len(times_s))


def median_time(runs: "pd.DataFrame", *, of: str) -> Estimate:
    """Return the Kaplan-Meier median of the time (s) from the first alert to a hazard.

    Times are censored at the end of the run (column `t_end`, simulated seconds). The median is infinite if
    most alerts are not followed by a hazard.
    """
    selected_runs = _select_runs(runs, of)
    if selected_runs["t_end"].isna().any():
        nan = math.nan
        return Estimate(value=nan, low=nan, high=nan, n=0, text="- (the ends of the runs are not known)")
    ends = {
        str(scenario): float(group["t_end"].iloc[0]) for scenario, group in selected_runs.groupby("scenario")
    }
    reaction = event_time_statistics.alert_to_hazard_times(selected_runs, ends, 0.0)
    median, low, high = reaction.median_s, reaction.median_low_s, reaction.median_high_s
    if reaction.runs_alerted_first and math.isnan(low):  # the curve stays above one half or jumps past it
        median = math.inf if math.isnan(median) else median
        if reaction.runs_alerted_first >= _MIN_RUNS_TO_BOUND_MEDIAN:
            low = high = median
    return _time_estimate(median, low, high, reaction.runs_alerted_first)


def estimate_of_share(share: Share) -> Estimate:
    return Estimate(
        value=share.rate,
        low=share.low,
        high=share.high,
        n=share.of,
        count_with_property=share.count,
        text=str(share),
    )


def estimate_of_difference(first: Share, second: Share) -> Estimate:
    """Return the first share minus the second, for separate sets of runs (Newcombe, statsmodels). Weighted
    shares are combined in the same way, from their own intervals.
    """
    from statsmodels.stats.proportion import confint_proportions_2indep

    low = high = math.nan
    if first.weighted_rate is not None or second.weighted_rate is not None:
        change = first.rate - second.rate
        low = change - math.hypot(first.rate - first.low, second.high - second.rate)
        high = change + math.hypot(first.high - first.rate, second.rate - second.low)
    elif first.of and second.of:
        low, high = confint_proportions_2indep(
            first.count,
            first.of,
            second.count,
            second.of,
            method="newcomb",
            compare="diff",
            alpha=1 - CONFIDENCE_LEVEL,
        )
    difference = first.rate - second.rate
    text = _describe_difference(difference, low, high, first, second)
    return Estimate(value=difference, low=float(low), high=float(high), n=min(first.of, second.of), text=text)


def _select_runs(runs: "pd.DataFrame", query: str) -> "pd.DataFrame":
    return runs.query(query, engine="python") if query else runs


def _measure_share(runs: "pd.DataFrame", of: str, part: str) -> Share:
    import pandas as pd

    query_words = {*re.findall(r"\w+", f"{of} {part}"), "fault_id", WEIGHT_COLUMN}
    # selecting rows is slow with all columns
    selected_runs = _select_runs(runs[[name for name in runs.columns if name in query_words]], of)
    is_in_part = selected_runs.index.isin(_select_runs(selected_runs, part).index)
    return share_of_runs(selected_runs, pd.Series(is_in_part), pd.Series(True, index=selected_runs.index))


def _describe_difference(
    difference: float, low: float, high: float, first: Share, second: Share, extra_note: str = ""
) -> str:
    shares_text = f"{_describe_share(first)} against {_describe_share(second)}"
    if math.isnan(difference):
        return shares_text
    if math.isnan(low):
        return f"{100 * difference:+.1f} points (no interval{extra_note}): {shares_text}"
    return (
        f"{100 * difference:+.1f} points ({100 * low:+.1f} to {100 * high:+.1f}{extra_note}): {shares_text}"
    )


def _describe_share(share: Share) -> str:
    return f"{100 * share.rate:.1f} % ({share.count}/{share.of})" if share.of else "- (0/0)"


def _time_estimate(time_s: float, low: float, high: float, run_count: int) -> Estimate:
    interval = "" if math.isnan(low) else f"; {low:.2f} to {high:.2f}"
    text = f"{time_s:.2f} s (N {run_count}{interval})" if run_count else "- (N 0)"
    return Estimate(value=time_s, low=low, high=high, n=run_count, text=text)


MEASURES = {
    f.__name__: f
    for f in (share, difference, clustered_difference, stratified, paired, mean_time, median_time)
}
