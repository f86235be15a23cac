"""The data that a report is made from, and the interface through which a study adds to it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, cast

from mutator.campaigns.installed_studies import load_installed_study
from mutator.errors import MutatorError
from mutator.figures.drawings import Drawing
from mutator.model import Experiment, Fault, Record, Status
from mutator.outcomes.fault_free_runs import FaultFreeRun, latest_end_by_scenario, load_fault_free_runs
from mutator.outcomes.fault_paths import fault_paths_of
from mutator.report.change_since_run_before import ChangeSinceRunBefore
from mutator.report.engine_summary import EngineSummary, summarize_engines
from mutator.report.experiment_facts import RANK_COLUMN, UNTIMED_PATH_COLUMN, ExperimentFacts
from mutator.report.explored_planes import ExploredPlanes
from mutator.report.fault_path_page_data import RunFaultPaths
from mutator.report.panel import Panel
from mutator.report.random_searches import RandomSearch
from mutator.report.reported_sets import ReportedSet, load_reported_sets
from mutator.report.search_findings import SearchFindings
from mutator.report.source_lines_with_outcomes import SourceLines
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_reader import Results
from mutator.statistics.published_counts import PublishedCounts
from mutator.statistics.results_frame import prepare_results
from mutator.statistics.sample_weights import SampledPlan, sampled_plan, with_weights
from mutator.store import plan_file
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportedRun:
    """The data that a report is made from. `results` are all experiments with a record, `frame` the usable
    ones. `faults` are those of the plan; `experiments` (the plan) and `records` are read on access. Without a
    workspace, no experiment can be rerun, and there is no study. `has_study_page`: the study has its own
    page on these results. `change` is that against the run before. `explored` is what an exploration found,
    `random_searches` what others drew at random.
    """

    folder: RunFolder
    workspace: Workspace | None
    results: "DataFrame"
    frame: "DataFrame"
    published_work: "PublishedWork | None"
    experiment_facts: ExperimentFacts
    engine_summary: EngineSummary | None = None
    has_study_page: bool = False
    change: ChangeSinceRunBefore | None = None
    explored: ExploredPlanes | SearchFindings | None = None
    random_searches: tuple[RandomSearch, ...] = ()
    run_fault_paths: RunFaultPaths | None = None
    source_lines: SourceLines | None = None
    faults: Mapping[str, Fault] = field(default_factory=dict)
    experiments: Mapping[str, Experiment] = field(default_factory=dict)
    records: Mapping[str, Record] = field(default_factory=dict)
    # empty until they are read: a run can have thousands
    _loaded_fault_free_runs: list[tuple[FaultFreeRun, ...]] = field(default_factory=list)
    _loaded_sets: list[tuple[ReportedSet, ...]] = field(default_factory=list)

    @classmethod
    def open(cls, folder: RunFolder, workspace: Workspace | None) -> "ReportedRun":
        """Open a run folder whose tables are up to date."""
        experiments, records = PlannedExperiments(folder.path), folder.records()
        faults, fault_paths = plan_file.load_faults(folder.path), fault_paths_of(folder)
        results = Results(folder.path).frame()
        facts = ExperimentFacts.of(folder, results, experiments, records, faults, fault_paths)
        return cls(
            folder=folder,
            workspace=workspace,
            results=results,
            frame=with_weights(
                prepare_results(
                    results.assign(
                        **{
                            RANK_COLUMN: facts.worst_first_ranks,
                            UNTIMED_PATH_COLUMN: facts.untimed_path_indices,
                        }
                    )
                ),
                folder.path,
            ),
            engine_summary=summarize_engines(folder, records, facts.timings),
            published_work=_find_published_work(folder) if workspace else None,
            experiment_facts=facts,
            explored=ExploredPlanes.of_run(folder, workspace),
            faults=faults,
            run_fault_paths=RunFaultPaths.of(
                folder, fault_paths, experiments, records, facts.distinct_untimed_paths
            )
            if fault_paths
            else None,
            source_lines=SourceLines.of(folder, workspace, results, faults),
            experiments=experiments,
            records=records,
        )

    @property
    def rows(self) -> tuple[ResultRow, ...]:
        """The results as objects. For large runs use `results` or `frame`."""
        return tuple(rows_of(self.results, self.faults))

    @property
    def sampled_plan(self) -> SampledPlan | None:
        """What the experiments were drawn from, or that an exploration chose them; None of a whole plan."""
        return sampled_plan(self.frame, self.folder.path)

    @property
    def has_rates(self) -> bool:
        """Whether counts of experiments are rates of a plan: not if these are an even sample, or chosen by an
        exploration.
        """
        sample = self.sampled_plan
        return sample is None or not (sample.is_even or sample.is_explored)

    @property
    def ran_count(self) -> int:
        """The number of planned experiments that ran."""
        not_run = (Status.HARNESS_ERROR.value, Status.LEFT_OUT.value)
        return int((~self.results["status"].isin(not_run)).sum())

    def defended_sets(self) -> tuple[ReportedSet, ...]:
        """Return the sets of defences that have results; MutatorError if they cannot be compared."""
        if not self._loaded_sets:
            manifest = manifest_if_any(self.folder, self.workspace)
            self._loaded_sets.append(load_reported_sets(self.folder, manifest))
        return self._loaded_sets[0]

    def fault_free_runs(self) -> tuple[FaultFreeRun, ...]:
        """Return what is known of the golden runs; empty if these cannot be read."""
        if self.workspace is None:
            return ()
        if not self._loaded_fault_free_runs:
            try:
                manifest = self.workspace.manifest_of(self.folder.head)
                self._loaded_fault_free_runs.append(load_fault_free_runs(self.folder, manifest))
            except (MutatorError, KeyError):
                self._loaded_fault_free_runs.append(())
        return self._loaded_fault_free_runs[0]

    def latest_golden_end_by_scenario(self) -> dict[str, float] | None:
        """Return the latest end of each scenario's golden runs, in simulated seconds; None if one cannot be
        read.
        """
        if self.workspace is None:
            return None
        try:
            return latest_end_by_scenario(self.folder, self.workspace.manifest_of(self.folder.head))
        except (MutatorError, KeyError):
            return None


@dataclass(frozen=True, slots=True, kw_only=True)
class PublishedWork:
    """Published work with which runs are compared, provided by an entry point in `mutator.studies`. `about`
    cites it. `check` finds problems in its data in a fault library. `published` returns the counts to show
    next to those of a run, or None if they do not apply. Each function in `panels` can return a panel of
    the study's page, with files next to it. If none returns a panel, there is no page. `drawings`
    returns the figures of that page. TypeError if a part is no function.
    """

    about: str
    check: Callable[[Workspace], Iterable[MutatorError]]
    published: Callable[[ReportedRun], PublishedCounts | None]
    panels: tuple[Callable[[ReportedRun], Panel | None], ...]
    drawings: Callable[[ReportedRun], tuple[Drawing, ...]]

    def __post_init__(self) -> None:
        parts = {"check": self.check, "published": self.published, "drawings": self.drawings}
        parts |= {f"panels[{i}]": panel for i, panel in enumerate(self.panels)}
        if not_callable := [name for name, part in parts.items() if not callable(part)]:
            raise TypeError(f"of a study, {', '.join(not_callable)} must be a function")


def _find_published_work(folder: RunFolder) -> PublishedWork | None:
    name = folder.head.study
    try:
        return cast(PublishedWork, load_installed_study(name)) if name else None
    except MutatorError:
        return None


def manifest_if_any(folder: RunFolder, workspace: Workspace | None) -> TargetManifest | None:
    """Return the manifest of a run's target; None without a library that has it."""
    try:
        return workspace.manifest_of(folder.head) if workspace else None
    except MutatorError:
        return None
