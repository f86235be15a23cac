"""Tables that compare guided with random triggers."""

import pandas as pd

from mutator.statistics import guided_against_random
from mutator.statistics.guided_against_random import WHOLES, Whole
from mutator.statistics.paired_statistics import Matched
from mutator.statistics.published_counts import OURS, Published, by_source
from mutator.statistics.shares import share
from mutator.statistics.statistics_sheet import Cell, P, Sheet
from mutator.statistics.tallies import by_kind


def overall_sheet(frame: pd.DataFrame, published: Published | None) -> Sheet:
    sources = by_source(published, by_kind(frame))
    lines: list[tuple[Cell, ...]] = []
    for whole in WHOLES:
        for source, counts in sources.items():
            parts = guided_against_random.strata(counts, whole)
            pooled = guided_against_random.mantel_haenszel(parts)
            rates = (
                share(sum(s.guided_hazards for s in parts), sum(s.guided for s in parts)),
                share(sum(s.random_hazards for s in parts), sum(s.random for s in parts)),
            )
            odds = (pooled.strata, pooled.odds_ratio, pooled.low, pooled.high, P(pooled.p), P(pooled.p_equal))
            lines.append((whole, source, *rates, *odds, *_resampled(frame, whole, source)))
    return Sheet(
        name="guided_against_random",
        title="Guided against random: hazards",
        note="The table covers fault types that have faults of both methods. Odds ratio: Mantel-Haenszel "
        "over fault types, above 1 if guided faults are more hazardous. The column `p` tests that the odds "
        "ratio is 1, and `p equal` that it is the same in all fault types; both p-values are too small, "
        "because the tests assume independent runs. Difference: the rate of guided minus that of random "
        "faults, as a fraction. Its interval comes from resampling whole faults (location and value); there "
        "is none if all faults agree, or for published counts.",
        heads=(
            *("hazards of", "from", "guided", "random", "fault types"),
            *("odds ratio", "odds ratio, low", "odds ratio, high", "p", "p equal"),
            *("difference", "difference, low", "difference, high", "faults"),
        ),
        lines=tuple(lines),
    )


def _resampled(frame: pd.DataFrame, whole: Whole, source: str) -> tuple[Cell, ...]:
    if source != OURS:  # resampling needs single runs, which are not published
        return (None,) * 4
    found = guided_against_random.resampled(frame, whole)
    return (found.difference, found.low, found.high, found.clusters)


def kinds_sheet(frame: pd.DataFrame, published: Published | None) -> Sheet:
    sources = by_source(published, by_kind(frame))
    lines: list[tuple[Cell, ...]] = []
    for whole in WHOLES:
        for source, counts in sources.items():
            parts = guided_against_random.strata(counts, whole)
            p_values = [guided_against_random.fisher(stratum) for stratum in parts]
            for stratum, p, adjusted in zip(
                parts, p_values, guided_against_random.holm(p_values), strict=True
            ):
                guided = share(stratum.guided_hazards, stratum.guided)
                random = share(stratum.random_hazards, stratum.random)
                lines.append((whole, source, stratum.kind, guided, random, P(p), P(adjusted)))
    return Sheet(
        name="guided_against_random_by_fault_type",
        title="Guided against random by fault type",
        note="The column `p` is from Fisher's exact test; `p, Holm` is adjusted over all fault types with "
        "the same `hazards of` and `from`.",
        heads=("hazards of", "from", "fault type", "guided", "random", "p", "p, Holm"),
        lines=tuple(lines),
    )


def pairs_sheet(frame: pd.DataFrame) -> Sheet:
    paired = guided_against_random.pairs(frame)
    lines: list[tuple[Cell, ...]] = []
    for which, some in (
        ("all", paired),
        ("guided one activated", paired[paired["is_activated_guided"]]),
    ):
        if some.empty:
            continue
        kinds = {str(kind): guided_against_random.mcnemar(group) for kind, group in some.groupby("kind")}
        adjusted = guided_against_random.holm([matched.p for matched in kinds.values()])
        lines.append((which, "total", *_cells(guided_against_random.mcnemar(some)), None))
        lines += [
            (which, kind, *_cells(matched), P(p))
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


def _cells(matched: Matched) -> tuple[Cell, ...]:
    counts = (matched.pairs, matched.both, matched.first_only, matched.second_only, matched.neither)
    return (*counts, P(matched.p))
