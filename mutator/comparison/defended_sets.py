"""The sets of defences of a campaign: each run with defences, paired with the undefended run."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from mutator.campaigns.bench_files import load_campaign_of_run
from mutator.campaigns.defended_runs import list_defended_runs, plan_problems
from mutator.comparison.compared_runs import ComparedRun, load_compared_run
from mutator.comparison.defended_pairs import (
    DefendedPair,
    DefendedRow,
    PairOutcome,
    pair_of,
)
from mutator.defences.defence_facts import set_name
from mutator.model import DefenceActivity, Outcome, Status
from mutator.outcomes.defence_reports import load_activities
from mutator.results.hazards_caused_by_defences import (
    caused_golden_hazards,
    caused_golden_hazards_note,
    golden_hazard_names,
)
from mutator.results.result_rows import ResultRow, cells_by_row
from mutator.results.table_building import PARQUET_FILE
from mutator.results.table_reader import Results
from mutator.store.golden_runs import GoldenRun
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
    they cause a hazard; `missing_count`: the undefended results that have no pair, because the set is not
    finished.
    """

    name: str
    undefended: ComparedRun
    defended: ComparedRun
    pairs: tuple[DefendedPair, ...]
    golden_activities: tuple[GoldenActivity, ...]
    caused_goldens: tuple[str, ...]
    missing_count: int = 0

    @property
    def false_goldens(self) -> tuple[str, ...]:
        """The golden runs in which a defence acts, although the undefended one has no hazard."""
        return tuple(dict.fromkeys(a.golden for a in self.golden_activities if a.is_false))

    @property
    def lost_count(self) -> int:
        """The number of undefended hazards whose run with defences has no result that can be compared."""
        return sum(bool(pair.undefended.hazards) for pair in self.select(PairOutcome.NOT_COMPARED))

    @property
    def count_by_outcome(self) -> "Counter[PairOutcome]":
        return Counter(pair.outcome for pair in self.pairs)

    def select(self, *outcomes: PairOutcome) -> tuple[DefendedPair, ...]:
        """Return the pairs with one of these outcomes, the worst undefended hazards first."""
        pairs = [pair for pair in self.pairs if pair.outcome in outcomes]
        return tuple(sorted(pairs, key=lambda pair: _harm(pair.undefended, pair.defended), reverse=True))


def load_defended_sets(run: RunFolder) -> tuple[DefendedSet, ...]:
    """Return the sets of a campaign whose runs have results, in the order of the campaign.

    MutatorError as for a comparison (checks that did not pass, or a failed equivalence check), and for a set
    whose plan or defences are others.
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
    for problem in plan_problems(defended.folder, undefended.folder):
        raise problem
    frame = Results(path).frame()
    facts = {cells["experiment_id"]: DefendedRow.of_cells(cells) for cells in cells_by_row(frame)}
    row_by_id = _rows_with_caused_hazards(undefended.folder, defended)
    pairs = tuple(
        pair_of(undefended.row_by_id[e.id], row_by_id[e.id], facts[e.id], observe_s)
        for e in undefended.experiments
        if e.id in undefended.row_by_id and e.id in facts
    )
    return DefendedSet(
        name=path.name,
        undefended=undefended,
        defended=defended,
        pairs=pairs,
        golden_activities=tuple(_golden_activities(undefended.folder, defended.folder)),
        caused_goldens=tuple(caused_golden_hazards(undefended.folder, defended.folder)),
        missing_count=len(undefended.row_by_id) - len(pairs),
    )


def _rows_with_caused_hazards(undefended: RunFolder, defended: ComparedRun) -> dict[str, ResultRow]:
    """Return the rows of a defended run with all hazards of the drive that the undefended golden run does not
    have. Records count those of the defended golden run apart, because the fault did not cause them.
    """
    if not defended.folder.golden_hazards:
        return defended.row_by_id
    rows, records = dict(defended.row_by_id), defended.folder.records()
    several_seeds = defended.folder.has_seeded_goldens
    for experiment in defended.experiments:
        row, record = rows.get(experiment.id), records.get(experiment.id)
        if row is None or record is None or record.status is not Status.OK:
            continue
        key = GoldenRun.for_experiment(experiment, several_seeds=several_seeds).key
        usual = golden_hazard_names(undefended, key)
        if usual and record.outcome is Outcome.NOT_JUDGED:
            continue  # whose hazards these are is not known
        # a fault that was never active leaves the drive as the golden run
        is_golden = record.outcome is Outcome.NOT_ACTIVATED
        others = defended.folder.golden_hazards.get(key, ()) if is_golden else record.golden_hazards
        hazards = (*row.hazards, *((name, t) for name, t in others if name not in usual))
        rows[experiment.id] = replace(row, hazards=tuple(sorted(hazards, key=lambda hazard: hazard[1])))
    return rows


def describe_caused_golden_hazards(run: RunFolder) -> str:
    """Return a line for each set of defences that causes a hazard without a fault; '' if none does."""
    notes = (caused_golden_hazards_note(run, RunFolder.open(path)) for path in list_defended_runs(run.path))
    return "\n".join(filter(None, notes))


def _golden_activities(undefended: RunFolder, defended: RunFolder) -> Iterator[GoldenActivity]:
    defences = defended.head.defences
    commands = list(dict.fromkeys(command for defence in defences for command in defence.commands))
    for golden in defended.goldens_with_files:
        folder = defended.golden_folder(*golden)
        if not folder.is_dir():
            continue
        hazards = [golden_hazard_names(run, golden.key) for run in (undefended, defended)]
        for activity in load_activities([defence.name for defence in defences], commands, folder):
            yield GoldenActivity(golden.key, activity, *hazards)


def _harm(undefended: ResultRow, defended: ResultRow) -> tuple[str, float]:
    worst = max(undefended, defended, key=lambda row: row.severity)
    return worst.severity, worst.delta_v or 0.0
