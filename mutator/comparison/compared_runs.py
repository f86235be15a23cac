"""A run's experiments and results, as one side of a comparison."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

from mutator.campaigns.row_filters import matching_items
from mutator.model import Experiment, Record, Value
from mutator.preflight import equivalence_check
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.plan_columns import columns_of_plan, plan_row
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_reader import frame_of_experiments
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.store import plan_file
from mutator.store.plan_strata import Stratum, load_strata, stratum_of
from mutator.store.preflight_results import check_verdicts_are_final
from mutator.store.run_folder import RunFolder
from mutator.targets.hazard_severity import SeverityScale
from mutator.targets.stored_target_facts import DRIVE_END_COLUMN


class ExperimentKey(NamedTuple):
    """Identifies an experiment across runs, independently of target, reading, setting and seed. Ids can
    differ across runs, because they depend on drawn times, reading, setting and the scenario's text.
    """

    spec: str  # with the variant: sensor/bias/distance
    value: Value
    scenario: str
    method: str
    trigger: str  # the trigger's name: C1, random/C1


@dataclass(frozen=True, kw_only=True)
class ComparedRun:
    """One run: its folder, its planned experiments, and their rows, metrics and ranks (0: the worst) by id.
    Metrics without a value are left out.
    """

    folder: RunFolder
    experiments: tuple[Experiment, ...]
    row_by_id: dict[str, ResultRow]
    metrics_by_id: dict[str, dict[str, float]] = field(default_factory=dict)
    rank_by_id: dict[str, int] = field(default_factory=dict)

    @property
    def name(self) -> str:
        return self.folder.path.name

    @cached_property
    def stratum_by_id(self) -> dict[str, tuple[Stratum, int]] | None:
        """The stratum of each experiment, and how many were planned in it before the draw; None without a
        sample.
        """
        strata = load_strata(self.folder.path)
        if strata is None:
            return None
        names = {
            e.id: stratum_of(strata.draw, e.fault.spec, e.family_or_scenario, e.method.value)
            for e in self.experiments
        }
        return {name: (stratum, strata.size_by_stratum[stratum]) for name, stratum in names.items()}

    def classified_by(self, scale: SeverityScale | None) -> "ComparedRun":
        """Return this side with hazards classified by `scale`, or unclassified if it is None."""
        rows = {}
        for name, row in self.row_by_id.items():
            metrics = self.metrics_by_id.get(name, {})
            worst = scale.worst_hazard(row.hazards, metrics, row.t_end) if scale else None
            severity, label = (worst.severity, scale.labels[worst.severity]) if scale and worst else ("", "")
            rows[name] = replace(row, severity=severity, severity_label=label)
        return replace(self, row_by_id=rows)


def load_compared_run(run: Path, only: str | None = None) -> ComparedRun:
    """Read the run folder `run` and its experiments that match `only`, a filter over plan columns.

    Raise MutatorError if `run` is not a run folder, or has checks that did not pass, and CheckFailed if its
    equivalence check failed.
    """
    folder = RunFolder.open(run)
    check_verdicts_are_final(folder)
    records = folder.records()
    equivalence_check.compare_sample(folder, records)
    experiments = tuple(plan_file.load_experiments(folder.path))
    if only:
        columns = columns_of_plan(folder.head.families)
        names = [column.name for column in columns]
        experiments = tuple(matching_items(experiments, only, names, lambda e: plan_row(e, columns)))
    faults = {e.fault.id: e.fault for e in experiments}
    sentences = ExperimentSentences.of_run(folder.head)
    frame = frame_of_experiments(folder, experiments)
    ranks = worst_first_ranks(frame).tolist()
    return ComparedRun(
        folder=folder,
        experiments=experiments,
        row_by_id={row.experiment_id: row for row in rows_of(frame, faults, sentences)},
        metrics_by_id={e.id: _metrics_of(records[e.id]) for e in experiments if e.id in records},
        rank_by_id=dict(zip(frame["experiment_id"].tolist(), ranks, strict=True)),
    )


def _metrics_of(record: Record) -> dict[str, float]:
    return dict(record.metrics) | ({DRIVE_END_COLUMN: record.t_end} if record.t_end is not None else {})


def experiment_key(experiment: Experiment) -> ExperimentKey:
    fault = experiment.fault
    return ExperimentKey(
        fault.spec, fault.value, experiment.scenario, experiment.method.value, experiment.trigger.name
    )
