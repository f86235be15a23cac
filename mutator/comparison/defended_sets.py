"""The sets of defences of a campaign: each run with defences, paired with the undefended run."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.defended_runs import list_defended_runs
from mutator.comparison.compared_runs import ComparedRun, load_compared_run
from mutator.comparison.defended_pairs import (
    DefendedPair,
    DefendedRow,
    PairOutcome,
    command_by_authority_column,
    pair_of,
)
from mutator.defences.defence_facts import DefenceFacts, set_name
from mutator.model import DefenceActivity
from mutator.outcomes.defence_reports import load_activities
from mutator.results.columns_of_defences import AUTHORITY_PREFIX
from mutator.results.result_rows import ResultRow, cells_by_row
from mutator.results.table_building import PARQUET_FILE
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder


class GoldenActivity(NamedTuple):
    """What a defence did in a golden run, and the hazards of this run without and with the defences."""

    golden: str
    activity: DefenceActivity
    undefended_hazards: tuple[str, ...]
    defended_hazards: tuple[str, ...]

    @property
    def is_false(self) -> bool:
        """Whether nothing called for it: the undefended run has no hazard."""
        return not self.undefended_hazards


@dataclass(frozen=True, slots=True, kw_only=True)
class DefendedSet:
    """A set of defences with its pairs, in the order of the plan.

    `golden_activities`: what its defences did without a fault; `caused_goldens`: the golden runs in which
    they cause a hazard.
    """

    name: str
    folder: RunFolder
    defences: tuple[DefenceFacts, ...]
    pairs: tuple[DefendedPair, ...]
    golden_activities: tuple[GoldenActivity, ...]
    caused_goldens: tuple[str, ...]

    @property
    def count_by_outcome(self) -> "Counter[PairOutcome]":
        return Counter(pair.outcome for pair in self.pairs)

    def select(self, *outcomes: PairOutcome) -> tuple[DefendedPair, ...]:
        """Return the pairs with one of these outcomes, the worst undefended hazards first."""
        pairs = [pair for pair in self.pairs if pair.outcome in outcomes]
        return tuple(sorted(pairs, key=lambda pair: _harm(pair.undefended, pair.defended), reverse=True))


def load_defended_sets(run: RunFolder) -> tuple[DefendedSet, ...]:
    """Return the sets of a campaign whose runs have results, in the order of the campaign.

    MutatorError as for a comparison: checks that did not pass, or a failed equivalence check.
    """
    paths = {path.name: path for path in list_defended_runs(run.path) if (path / PARQUET_FILE).is_file()}
    if not paths:
        return ()
    campaign = load_campaign_of_run(run)
    undefended = load_compared_run(run.path)
    names = [set_name(names) for names in campaign.defence_sets]
    return tuple(_load_set(undefended, paths[name], campaign.observe_s) for name in names if name in paths)


def _load_set(undefended: ComparedRun, path: Path, observe_s: float) -> DefendedSet:
    defended = load_compared_run(path)
    frame = Results(path).frame()
    commands = command_by_authority_column([str(name) for name in frame.columns], AUTHORITY_PREFIX)
    facts = {cells["experiment_id"]: DefendedRow.of_cells(cells, commands) for cells in cells_by_row(frame)}
    pairs = tuple(
        pair_of(undefended.row_by_id[e.id], defended.row_by_id[e.id], facts[e.id], observe_s)
        for e in undefended.experiments
        if e.id in undefended.row_by_id and e.id in facts
    )
    hazards_before, hazards_after = undefended.folder.golden_hazards, defended.folder.golden_hazards
    return DefendedSet(
        name=path.name,
        folder=defended.folder,
        defences=defended.folder.head.defences,
        pairs=pairs,
        golden_activities=tuple(_golden_activities(undefended.folder, defended.folder)),
        caused_goldens=tuple(sorted(hazards_after.keys() - hazards_before.keys())),
    )


def _golden_activities(undefended: RunFolder, defended: RunFolder) -> Iterator[GoldenActivity]:
    defences = defended.head.defences
    commands = list(dict.fromkeys(command for defence in defences for command in defence.commands))
    for golden in defended.goldens_with_files:
        folder = defended.golden_folder(*golden)
        if not folder.is_dir():
            continue
        hazards = [_golden_hazards(run, golden.key) for run in (undefended, defended)]
        for activity in load_activities([defence.name for defence in defences], commands, folder):
            yield GoldenActivity(golden.key, activity, *hazards)


def _golden_hazards(run: RunFolder, key: str) -> tuple[str, ...]:
    return tuple(name for name, _ in run.golden_hazards.get(key, ()))


def _harm(undefended: ResultRow, defended: ResultRow) -> tuple[str, float]:
    worst = max(undefended, defended, key=lambda row: row.severity)
    return worst.severity, worst.delta_v or 0.0
