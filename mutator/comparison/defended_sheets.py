"""The tables of sets of defences: what they did with each hazard, what it took, and what it cost."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from mutator.comparison.defence_cost_sheets import cost_sheets
from mutator.comparison.defended_contacts_sheet import contacts_sheet
from mutator.comparison.defended_pairs import PAIR_OUTCOME_MEANINGS, DefendedPair, PairOutcome
from mutator.comparison.defended_sets import DefendedSet
from mutator.comparison.paired_rate_and_time_sheets import weights_of_experiments
from mutator.results.result_rows import ResultRow
from mutator.statistics.paired_statistics import mcnemar_test, rate_difference
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.shares_with_intervals import Share
from mutator.statistics.statistics_sheet import PValue, Sheet, SheetCell
from mutator.statistics.weighted_shares import share_of_runs

if TYPE_CHECKING:
    import pandas as pd

_HAZARD_OUTCOMES = (
    PairOutcome.PREVENTED,
    PairOutcome.OPEN,
    PairOutcome.REPLACED,
    PairOutcome.MITIGATED,
    PairOutcome.UNCHANGED,
    PairOutcome.WORSENED,
)
_MEANINGS = " ".join(
    f"*{outcome.words.capitalize()}*: {PAIR_OUTCOME_MEANINGS[outcome]}."
    for outcome in (*_HAZARD_OUTCOMES, PairOutcome.CAUSED, PairOutcome.NOT_COMPARED)
)
_NONE, _OPEN = "none", "open"  # columns of the matrix of hazards


def defence_sheets(sets: Sequence[DefendedSet], hazards: Sequence[str]) -> tuple[Sheet, ...]:
    """Return the tables of these sets, for the hazards of their target."""
    return (
        _outcomes_sheet(sets),
        _rates_sheet(sets),
        _hazards_sheet(sets, hazards),
        _severity_sheet(sets),
        contacts_sheet(sets),
        *cost_sheets(sets),
        _pairs_sheet(sets),
        _experiments_sheet(sets),
    )


def _outcomes_sheet(sets: Iterable[DefendedSet]) -> Sheet:
    return Sheet(
        name="defences",
        title="What defences did with hazards",
        note="Experiments with a hazard in the undefended run, by what became of it with each set. "
        f"{_MEANINGS} Of the *not compared*, only those with a hazard are counted. "
        "False activations are counted by fault-free drive. The interval of the prevented share resamples "
        "whole faults. A sample's share is weighted; counts are not.",
        heads=(
            *("defences", "hazards", "prevented", *(outcome.value for outcome in _HAZARD_OUTCOMES[1:])),
            *("not compared", "caused", "false activations", "unneeded activations", "with conflicts"),
        ),
        lines=tuple(_outcome_line(defended) for defended in sets),
    )


def _outcome_line(defended: DefendedSet) -> tuple[SheetCell, ...]:
    counts = defended.count_by_outcome
    return (
        defended.name,
        sum(counts[outcome] for outcome in _HAZARD_OUTCOMES),
        prevented_share(defended),
        *(counts[outcome] for outcome in _HAZARD_OUTCOMES[1:]),
        defended.lost_count,
        counts[PairOutcome.CAUSED],
        len(defended.false_goldens),
        sum(pair.is_unneeded_activation for pair in defended.pairs),
        sum(pair.facts.conflict_steps > 0 for pair in defended.pairs),
    )


def _rates_sheet(sets: Iterable[DefendedSet]) -> Sheet:
    return Sheet(
        name="defence_rates",
        title="Hazards with and without defences, in pairs",
        note="Experiments that have a result without and with the set, and how many have a hazard. "
        "Difference: the share with defences minus that without, weighted in a sample; its interval "
        "resamples whole faults. p: McNemar's exact test of the pairs that differ; `faults` is the number of "
        "faults behind them, which are fewer than the pairs that the test takes for independent.",
        heads=(
            *("defences", "pairs", "without", "with", "difference", "difference, low", "difference, high"),
            *("p", "pairs that differ", "faults"),
        ),
        lines=tuple(_rate_line(defended) for defended in sets),
    )


def _rate_line(defended: DefendedSet) -> tuple[SheetCell, ...]:
    frame = _compared_frame(defended)
    before, after, faults = frame["before"], frame["after"], frame["fault_id"]
    change = rate_difference(before, after, faults, frame[WEIGHT_COLUMN])
    return (
        *(defended.name, len(frame), int(before.sum()), int(after.sum())),
        *(change.difference, change.low, change.high),
        PValue(mcnemar_test(before, after).p_value),
        int((before != after).sum()),
        int(faults[before != after].nunique()),
    )


def prevented_share(defended: DefendedSet) -> Share:
    """Return which share of the undefended hazards is prevented, with an interval that resamples faults."""
    frame = _compared_frame(defended)
    return share_of_runs(frame, frame["prevented"], frame["before"])


def _compared_frame(defended: DefendedSet) -> "pd.DataFrame":
    """Return a frame with a row for each compared pair: its fault, its weight, and whether there was a hazard
    before (without defences) and after (with them), and whether it was prevented. The weight is 1 unless the
    undefended run is a sample.
    """
    import pandas as pd

    compared = [pair for pair in defended.pairs if pair.outcome is not PairOutcome.NOT_COMPARED]
    ids = [pair.undefended.experiment_id for pair in compared]
    strata = defended.undefended.stratum_by_id
    flags = {
        "before": [bool(pair.undefended.hazards) for pair in compared],
        "after": [bool(pair.defended.hazards) for pair in compared],
        "prevented": [pair.outcome is PairOutcome.PREVENTED for pair in compared],
    }
    return pd.DataFrame(
        {
            "fault_id": pd.Series([pair.undefended.fault for pair in compared], dtype=object),
            WEIGHT_COLUMN: pd.Series(weights_of_experiments(ids, strata) if strata else 1.0, range(len(ids))),
            **{name: pd.Series(values, dtype=bool) for name, values in flags.items()},
        }
    )


def _hazards_sheet(sets: Iterable[DefendedSet], hazards: Sequence[str]) -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for defended in sets:
        counts = Counter(
            (_first_hazard(pair.undefended) or _NONE, _end_with_defences(pair))
            for pair in defended.pairs
            if pair.outcome is not PairOutcome.NOT_COMPARED
        )
        lines += [
            (defended.name, before, *(counts[before, after] for after in (_NONE, _OPEN, *hazards)))
            for before in (*hazards, _NONE)
            if any(counts[before, after] for after in (_NONE, _OPEN, *hazards))
        ]
    return Sheet(
        name="defended_hazards",
        title="Hazards without and with defences",
        note="Numbers of experiments by their first hazard in the undefended run (rows) and with the set "
        "(columns). `open`: no hazard, but the drive ends too early to say that it was prevented.",
        heads=("defences", "undefended", _NONE, _OPEN, *hazards),
        lines=tuple(lines),
    )


def _first_hazard(row: ResultRow) -> str:
    return row.hazards[0][0] if row.hazards else ""


def _end_with_defences(pair: DefendedPair) -> str:
    return _OPEN if pair.outcome is PairOutcome.OPEN else _first_hazard(pair.defended) or _NONE


def _severity_sheet(sets: Iterable[DefendedSet]) -> Sheet:
    lines: list[tuple[SheetCell, ...]] = []
    for defended in sets:
        pairs = [pair for pair in defended.pairs if pair.outcome is not PairOutcome.NOT_COMPARED]
        counts = Counter((pair.undefended.severity, pair.defended.severity) for pair in pairs)
        for (before, after), count in sorted(counts.items()):
            if before or after:
                lines.append((defended.name, before or _NONE, after or _NONE, count))
    return Sheet(
        name="defended_severity",
        title="Severity without and with defences",
        note="Numbers of experiments by severity class; `none`: no hazard with a class.",
        heads=("defences", "undefended", "with defences", "experiments"),
        lines=tuple(lines),
    )


def _pairs_sheet(sets: Iterable[DefendedSet]) -> Sheet:
    return Sheet(
        name="defended_pairs",
        title="Experiments with defences",
        note="Each experiment of which a defence acted or a hazard changed.",
        heads=(
            *("experiment", "fault", "scenario", "trigger", "undefended", "severity", "defences", "outcome"),
            *("with defences", "severity with defences", "change of delta-v (m/s)", "acted"),
        ),
        lines=tuple(_pair_lines(sets)),
    )


def _pair_lines(sets: Iterable[DefendedSet]) -> Iterator[tuple[SheetCell, ...]]:
    for defended in sets:
        for pair in defended.pairs:
            before, after = pair.undefended, pair.defended
            if not (pair.facts.acted or before.hazards or after.hazards):
                continue
            both_touch = before.delta_v is not None and after.delta_v is not None
            yield (
                *(before.experiment_id, before.fault, before.scenario_label, before.trigger),
                *(_hazard_text(before), before.severity or None, defended.name, pair.outcome.value),
                *(_hazard_text(after), after.severity or None),
                (after.delta_v or 0.0) - (before.delta_v or 0.0) if both_touch else None,
                ", ".join(pair.facts.acted) or None,
            )


def _experiments_sheet(sets: Sequence[DefendedSet]) -> Sheet:
    pairs_by_id = [{pair.undefended.experiment_id: pair for pair in defended.pairs} for defended in sets]
    undefended = sets[0].undefended
    rows = [undefended.row_by_id[e.id] for e in undefended.experiments if e.id in undefended.row_by_id]
    return Sheet(
        name="defended_experiments",
        title="What became of each experiment with defences",
        note="One row for each experiment, one column for each set. An empty cell: the set has no result of "
        "it yet.",
        heads=("experiment", "fault", "scenario", "trigger", "undefended", *(f"with {d.name}" for d in sets)),
        lines=tuple(
            (
                *(row.experiment_id, row.fault, row.scenario_label, row.trigger, _hazard_text(row)),
                *(
                    pairs[row.experiment_id].what_became if row.experiment_id in pairs else None
                    for pairs in pairs_by_id
                ),
            )
            for row in rows
        ),
    )


def _hazard_text(row: ResultRow) -> str:
    return ", ".join(name for name, _ in row.hazards) or (_NONE if row.status == "ok" else row.ending)
