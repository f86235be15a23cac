"""Counts the seeds whose runs confirm each published observation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.table_rendering import TextTable
from mutator.paper.observation_judging import ClaimVerdict, JudgedObservation, judge_observations
from mutator.statistics.seed_spread_tables import seeds_of
from mutator.statistics.statistics_sheet import Sheet, SheetCell

if TYPE_CHECKING:
    import pandas as pd

JudgedObservationsBySeed = Mapping[str, Sequence[JudgedObservation]]

SEEDS_NOTE = (
    "Each seed repeats the whole campaign with different draws. The observations are judged on the runs of "
    "one seed at a time, by the same rules. One seed has fewer runs than all seeds, so more verdicts lack "
    "data."
)


def judge_by_seed(
    path: Path, runs: "pd.DataFrame", mixture_gaps_of: Callable[["pd.DataFrame"], Sequence[str]]
) -> JudgedObservationsBySeed:
    """Judge the observations on the runs of each seed separately. Empty if there is only one seed.

    `mixture_gaps_of` returns how a seed's runs differ from the paper's mixture of faults.
    """
    seeds = seeds_of(runs)
    if len(seeds) < 2:
        return {}
    groups = {str(seed): group for seed, group in runs.groupby("seed", observed=True)}
    return {
        seed: judge_observations(path, groups[seed], mixture_gaps_of(groups[seed]), only_needed=True)
        for seed in seeds
    }


def verdicts_by_seed_table(
    judged: Sequence[JudgedObservation], by_seed: JudgedObservationsBySeed
) -> TextTable:
    heads = ("observation", "", "all seeds together", *(verdict.value for verdict in ClaimVerdict), "seeds")
    rows = [
        (
            *(str(observation.number), observation.title, observation.verdict.value),
            *(
                str(len(_seeds_with_verdict(observation.number, verdict, by_seed)))
                for verdict in ClaimVerdict
            ),
            str(len(by_seed)),
        )
        for observation in judged
    ]
    return TextTable(heads=heads, rows=rows, right_aligned=range(3, len(heads)))


def _seeds_with_verdict(number: int, verdict: ClaimVerdict, by_seed: JudgedObservationsBySeed) -> list[str]:
    # numbers begin at 1
    return [seed for seed, judged in by_seed.items() if judged[number - 1].verdict is verdict]


def observations_by_seed_sheet(by_seed: JudgedObservationsBySeed) -> Sheet:
    return Sheet(
        name="observations_by_seed",
        title="The paper's observations by seed",
        note=SEEDS_NOTE,
        heads=(
            *("seed", "observation", "verdict of the observation", "claim", "says", "group"),
            *("N", "estimate", "low", "high", "verdict"),
        ),
        lines=tuple(_sheet_rows(by_seed)),
    )


def _sheet_rows(by_seed: JudgedObservationsBySeed) -> Iterator[tuple[SheetCell, ...]]:
    for seed, judged in by_seed.items():
        for observation in judged:
            for claim in observation.claims:
                for answer in claim.answers:
                    head = (
                        int(seed),
                        observation.number,
                        observation.verdict.value,
                        claim.number,
                        claim.claim.claim_text,
                        answer.group,
                    )
                    numbers = (
                        answer.estimate.n,
                        answer.estimate.value,
                        answer.estimate.low,
                        answer.estimate.high,
                    )
                    yield (*head, *numbers, answer.verdict.value)
