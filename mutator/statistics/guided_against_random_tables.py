"""Tables that compare guided with random triggers."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mutator.statistics import guided_against_random
from mutator.statistics.guided_against_random import METHODS, RATE_BASES, FaultTypeStratum, RateBase
from mutator.statistics.paired_statistics import PairCounts
from mutator.statistics.published_counts import THIS_RUN, PublishedCounts, counts_by_source
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.shares_with_intervals import Share, share_with_interval
from mutator.statistics.statistics_sheet import PValue, Sheet, SheetCell
from mutator.statistics.tallies import flag_of_count, tally_by_fault_type
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd


def hazard_odds_sheet(frame: "pd.DataFrame", published: PublishedCounts | None) -> Sheet:
    sources = counts_by_source(published, tally_by_fault_type(frame))
    lines: list[tuple[SheetCell, ...]] = []
    for base in RATE_BASES:
        for source, counts in sources.items():
            parts = guided_against_random.strata_with_both_methods(counts, base)
            pooled = guided_against_random.pool_odds_ratios(parts)
            rates = _method_rates(parts, frame if source == THIS_RUN else None, base)
            odds = (
                pooled.stratum_count,
                pooled.odds_ratio,
                pooled.low,
                pooled.high,
                PValue(pooled.p_of_odds_ratio_1),
                PValue(pooled.p_of_equal_odds_ratios),
            )
            lines.append((base, source, *rates, *odds, *_difference_cells(frame, base, source)))
    return Sheet(
        name="guided_against_random",
        title="Guided against random: hazards",
        note="The table covers fault types that have faults of both methods. Odds ratio: Mantel-Haenszel "
        "over fault types, above 1 if guided faults are more hazardous. The column `p` tests that the odds "
        "ratio is 1, and `p equal` that it is the same in all fault types; both p-values are too small, "
        "because the tests assume independent runs. Difference: the rate of guided minus that of random "
        "faults, as a fraction. Its interval comes from resampling whole faults (location and value); there "
        "is none if all faults agree, or for published counts. Rates and differences of a sample are "
        "weighted; odds ratios compare the drawn runs within fault types.",
        heads=(
            *("hazards of", "from", "guided", "random", "fault types"),
            *("odds ratio", "odds ratio, low", "odds ratio, high", "p", "p equal"),
            *("difference", "difference, low", "difference, high", "faults"),
        ),
        lines=tuple(lines),
    )


def _method_rates(
    parts: Sequence[FaultTypeStratum], runs: "pd.DataFrame | None", base: RateBase
) -> tuple[Share, Share]:
    """Return the hazard rates of guided and random faults, weighted if `runs` are a sample."""
    if runs is None or WEIGHT_COLUMN not in runs:
        return (
            share_with_interval(sum(s.guided_hazards for s in parts), sum(s.guided_runs for s in parts)),
            share_with_interval(sum(s.random_hazards for s in parts), sum(s.random_runs for s in parts)),
        )
    rows = runs[runs["kind"].isin([stratum.fault_type for stratum in parts])]
    whole = flag_of_count(rows, base)
    guided, random = (
        share_of_runs(rows, rows["is_hazard"], whole & (rows["method"] == method)) for method in METHODS
    )
    return guided, random


def _difference_cells(frame: "pd.DataFrame", base: RateBase, source: str) -> tuple[SheetCell, ...]:
    if source != THIS_RUN:  # resampling needs single runs, which are not published
        return (None,) * 4
    estimate = guided_against_random.resampled_rate_difference(frame, base)
    return (estimate.difference, estimate.low, estimate.high, estimate.fault_count)


def hazards_by_fault_type_sheet(frame: "pd.DataFrame", published: PublishedCounts | None) -> Sheet:
    sources = counts_by_source(published, tally_by_fault_type(frame))
    lines: list[tuple[SheetCell, ...]] = []
    for base in RATE_BASES:
        for source, counts in sources.items():
            parts = guided_against_random.strata_with_both_methods(counts, base)
            p_values = [guided_against_random.fisher_p(stratum) for stratum in parts]
            for stratum, p, adjusted in zip(
                parts, p_values, guided_against_random.holm_adjusted(p_values), strict=True
            ):
                guided, random = _method_rates((stratum,), frame if source == THIS_RUN else None, base)
                lines.append((base, source, stratum.fault_type, guided, random, PValue(p), PValue(adjusted)))
    return Sheet(
        name="guided_against_random_by_fault_type",
        title="Guided against random by fault type",
        note="The column `p` is from Fisher's exact test; `p, Holm` is adjusted over all fault types with "
        "the same `hazards of` and `from`.",
        heads=("hazards of", "from", "fault type", "guided", "random", "p", "p, Holm"),
        lines=tuple(lines),
    )


def matched_pairs_sheet(frame: "pd.DataFrame") -> Sheet:
    paired = guided_against_random.matched_pairs(frame)
    lines: list[tuple[SheetCell, ...]] = []
    for selection, selected in (
        ("all", paired),
        ("guided one activated", paired[paired["is_activated_guided"]]),
    ):
        if selected.empty:
            continue
        kinds = {
            str(kind): guided_against_random.mcnemar_of_pairs(group)
            for kind, group in selected.groupby("kind")
        }
        adjusted = guided_against_random.holm_adjusted([matched.p_value for matched in kinds.values()])
        lines.append(
            (selection, "total", *_pair_cells(guided_against_random.mcnemar_of_pairs(selected)), None)
        )
        lines += [
            (selection, kind, *_pair_cells(matched), PValue(p))
            for (kind, matched), p in zip(kinds.items(), adjusted, strict=True)
        ]
    return Sheet(
        name="matched_pairs",
        title="Guided and random runs of the same fault, in pairs",
        note="A pair is a guided and a random run with the same fault, scenario, context and seed. The table "
        "counts pairs in which both runs, only one or neither has a hazard. The column `p` is from McNemar's "
        "exact test; it is too small, because the test assumes that pairs of the same fault are independent. "
        "`p, Holm` is adjusted over fault types.",
        heads=("pairs", "fault type", "N", "both", "guided only", "random only", "neither", "p", "p, Holm"),
        lines=tuple(lines),
    )


def _pair_cells(matched: PairCounts) -> tuple[SheetCell, ...]:
    counts = (matched.pair_count, matched.both, matched.first_only, matched.second_only, matched.neither)
    return (*counts, PValue(matched.p_value))
