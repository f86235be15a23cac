"""Counts the seeds whose runs confirm each published observation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import pandas as pd

from mutator._common.table_rendering import Table
from mutator.paper.observations import JudgedObservation, Verdict, judge
from mutator.statistics.seed_spread import seeds_of
from mutator.statistics.statistics_sheet import Sheet, SheetCell

BySeed = Mapping[str, Sequence[JudgedObservation]]

ABOUT = (
    "Each seed repeats the whole campaign with different draws. The observations are judged on the runs of "
    "one seed at a time, by the same rules. One seed has fewer runs than all seeds, so more verdicts lack "
    "data."
)


def judge_by_seed(path: Path, runs: pd.DataFrame, lacks: Callable[[pd.DataFrame], Sequence[str]]) -> BySeed:
    """Judge the observations on the runs of each seed separately. Empty if there is only one seed.

    `lacks` returns how a seed's runs differ from the paper's mixture of faults.
    """
    seeds = seeds_of(runs)
    if len(seeds) < 2:
        return {}
    groups = {str(seed): group for seed, group in runs.groupby("seed", observed=True)}
    return {seed: judge(path, groups[seed], lacks(groups[seed]), only_needed=True) for seed in seeds}


def table(together: Sequence[JudgedObservation], by_seed: BySeed) -> Table:
    heads = ("observation", "", "all seeds together", *(verdict.value for verdict in Verdict), "seeds")
    rows = [
        (
            *(str(one.number), one.title, one.verdict.value),
            *(str(len(_seeds_of(one.number, verdict, by_seed))) for verdict in Verdict),
            str(len(by_seed)),
        )
        for one in together
    ]
    return Table(heads=heads, rows=rows, right=range(3, len(heads)))


def _seeds_of(number: int, verdict: Verdict, by_seed: BySeed) -> list[str]:
    return [seed for seed, judged in by_seed.items() if judged[number - 1].verdict is verdict]


def sheet(by_seed: BySeed) -> Sheet:
    return Sheet(
        name="observations_by_seed",
        title="The paper's observations by seed",
        note=ABOUT,
        heads=(
            *("seed", "observation", "verdict of the observation", "claim", "says", "group"),
            *("N", "estimate", "low", "high", "verdict"),
        ),
        lines=tuple(_cells(by_seed)),
    )


def _cells(by_seed: BySeed) -> Iterator[tuple[SheetCell, ...]]:
    for seed, judged in by_seed.items():
        for one in judged:
            for claim in one.claims:
                for a in claim.answers:
                    head = (int(seed), one.number, one.verdict.value, claim.number, claim.claim.says, a.group)
                    numbers = (a.found.n, a.found.estimate, a.found.low, a.found.high)
                    yield (*head, *numbers, a.verdict.value)
