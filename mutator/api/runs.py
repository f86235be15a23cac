"""A run folder, and what you can make from it: report, stills, exports, audit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import describe_choices, describe_seeds
from mutator._common.table_rendering import TextTable
from mutator.api.experiment_results import trace_frame
from mutator.api.notebook_html import facts_html, text_html
from mutator.api.run_experiments import RunExperiment
from mutator.api.run_figures import RunFigures
from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.audit.run_digests_and_seal import Seals, seals_of
from mutator.campaigns.defended_runs import list_defended_runs
from mutator.comparison.defended_sets import describe_caused_golden_hazards
from mutator.errors import MutatorError
from mutator.execution.session_summary import Summary
from mutator.exports import ExportSelection, Format, find_export
from mutator.exports import ExportTable as ExportedTable
from mutator.exports.run_export import export
from mutator.model import OPERATOR_FAULTS_MODULE
from mutator.outcomes.fault_free_runs import (
    FaultFreeRun,
    alerts_by_scenario_and_seed,
    fault_free_alerts_note,
    load_fault_free_runs,
)
from mutator.outcomes.trace_and_record_loading import load_trace
from mutator.preflight import equivalence_check
from mutator.report import report_builder
from mutator.report.experiment_stills import take_stills
from mutator.results import outcome_counting
from mutator.results import table_building as results_table
from mutator.results.note_on_golden_hazards import golden_hazards_note
from mutator.results.note_without_canary import no_canary_note
from mutator.statistics.family_statistics import scenarios_frame
from mutator.statistics.fault_free_drive_tables import (
    describe_drives,
    each_drive_sheet,
    load_judged_drives,
)
from mutator.statistics.mutation_score import mutation_score_sheet, totals_table
from mutator.statistics.results_frame import prepare_results
from mutator.statistics.sample_weights import with_weights
from mutator.statistics.statistics_sheet import Sheet
from mutator.store import run_deletion
from mutator.store.golden_files import GOLDEN_FOLDER, stored_golden_keys
from mutator.store.golden_runs import GoldenRun
from mutator.store.planned_scenarios import concrete_scenarios_of
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.targets.overhead_view_json import scene_as_json

if TYPE_CHECKING:
    import pandas as pd

    from mutator.api.audits import Audit


def load_run(path: str | Path, *, workspace: WorkspaceLike = None) -> "Run":
    """Open the run folder at `path`, finished or not. Content is read on first use.

    Traces and new reports need `workspace`; default: found when needed. MutatorError if `path` is not a run
    folder.
    """
    return Run(RunFolder.open(Path(path)), None if workspace is None else open_workspace(workspace))


def merge_runs(shards: Sequence[str | Path], out: str | Path, *, accept_versions: bool = False) -> "Run":
    """Merge the shards of a plan into the run folder `out`, with the same results as a run on a single
    machine.

    MutatorError if the shards are unfinished or do not make up one whole plan, or, without
    `accept_versions`, if their versions of Python or packages differ. CheckFailed if their golden runs
    differ.
    """
    if isinstance(shards, str | Path):  # a likely mistake; a text would be read letter by letter
        raise MutatorError(repr(str(shards)), argument="shards", expected="a list of run folders")
    from mutator.execution.shard_merging import merge_shards

    merge_shards([Path(shard) for shard in shards], Path(out), accept_versions=accept_versions)
    return load_run(out)


@dataclass(frozen=True, eq=False, repr=False)
class Run(RunFigures):
    """A run folder, read on demand."""

    #: the summary, if `mutator.run` returned this object; None for a loaded run
    summary: Summary | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.folder, RunFolder):
            raise MutatorError(
                repr(self.folder),
                argument="folder",
                expected="a RunFolder",
                remedy="open a run with mutator.load_run(path)",
            )

    def __repr__(self) -> str:
        head = self.folder.head
        progress = f"{sum(self.endings.values())} of {self.folder.planned_experiment_count} experiments"
        failed = len(self.harness_errors)
        errors = f", {failed} with a HARNESS ERROR" if failed else ""
        campaign = ", ".join(filter(None, (head.campaign, head.reading)))
        return f"<Run {self.path.name}: {progress} of {campaign}{errors}>"

    def _repr_html_(self) -> str:
        note = alerts_note_if_any(self)
        parts = text_html(repr(self)), facts_html(self.endings.items()), self.counts().as_html()
        return "".join(map(str, (*parts, text_html(note) if note else "")))

    @cached_property
    def seals(self) -> Seals:
        """The digests to publish, computed now: the seal, the results digest and the review digest."""
        return seals_of(self.folder)

    @property
    def seal(self) -> str | None:
        """The run's seal; None for a run that is unfinished."""
        return self.seals.seal

    @property
    def defended(self) -> dict[str, "Run"]:
        """The runs with sets of defences, by the names of the sets; empty if the campaign has none."""
        return {
            path.name: Run(RunFolder.open(path), self.given_workspace)
            for path in list_defended_runs(self.path)
        }

    def counts(self) -> TextTable:
        """Count how the experiments of each fault type ended."""
        frame = self._results_frame
        hazards, counts = (
            outcome_counting.checked_hazard_names(frame),
            outcome_counting.count_outcomes_by_group(frame, outcome_counting.fault_types_of(frame)),
        )
        heads, rows = outcome_counting.count_table(
            counts, "fault type", hazards, alerts=self.folder.has_alerts
        )
        return TextTable(heads=heads, rows=rows, right_aligned=range(1, len(heads)))

    def mutation_score(self) -> Sheet:
        """Return a sheet with the shares of the activated operator mutants that had each effect: changed an
        actuator, raised a new alert, caused a hazard; in total, by operator and by function. Empty without
        such mutants.
        """
        usable = with_weights(prepare_results(self._results_frame), self.path)
        if not (usable["module"] == OPERATOR_FAULTS_MODULE).any():
            return mutation_score_sheet(usable, {}, None)
        try:
            alerts = alerts_by_scenario_and_seed(self.fault_free())
        except (MutatorError, KeyError):  # without target or golden runs, alerts cannot be compared
            alerts = None
        return mutation_score_sheet(usable, self.faults, alerts, self.folder.head.operators)

    def mutation_totals(self) -> TextTable:
        """Return the rows of `mutation_score` for all operator mutants. Empty without such mutants."""
        return totals_table(self.mutation_score())

    def fault_free(self) -> tuple[FaultFreeRun, ...]:
        """Return the alerts and hazards of the golden runs, and the range of each plotted channel."""
        return load_fault_free_runs(self.folder, self.manifest)

    def drives(self) -> "pd.DataFrame":
        """Return a row for each golden run of a run with families or without faults: the values of its
        parameters, its hazards, alerts and metrics. Empty for other runs.
        """
        return each_drive_sheet(load_judged_drives(self.folder), self.folder.head.hazards).as_frame()

    def drives_note(self) -> str:
        """Return the drives, hours, hazards and alerts of `drives` in a sentence; empty if there are none."""
        drives = load_judged_drives(self.folder)
        return describe_drives(drives) if drives else ""

    @cached_property
    def families(self) -> "pd.DataFrame":
        """The concrete scenarios that families gave, a row each, indexed by name; empty without families.

        Columns: `family`, `label` (the values as text), each parameter, `golden_hazards` (joined by `;`; no
        value before the golden run), `golden_` and the name of each metric. Then come numbers of
        experiments with a valid result: `experiments`, by outcome, `failed` (crashed or timed out), and by
        hazard.
        """
        scenarios = concrete_scenarios_of(self.path).values()
        usable = prepare_results(self._results_frame)
        drives = load_judged_drives(self.folder)
        return scenarios_frame(self.folder.head.families, scenarios, usable, drives)

    def alerts_note(self) -> str:
        """Return a sentence on the alerts that golden runs also raise; empty if there are none."""
        return fault_free_alerts_note(self.fault_free())

    def no_canary_note(self) -> str:
        """Return a sentence on the first hazard of a campaign without a canary; empty if it has a canary."""
        return no_canary_note(self.folder, self._results_frame)

    def golden_hazards_note(self) -> str:
        """Return which experiments were left out because their golden run has a hazard, or how they are
        judged; empty if none has.
        """
        return golden_hazards_note(self.folder, self._results_frame)

    def defence_hazards_note(self) -> str:
        """Return a line for each set of defences that causes a hazard in a golden run; empty if none does."""
        return describe_caused_golden_hazards(self.folder)

    def experiment(self, id: str) -> RunExperiment:
        """Return the planned experiment whose id starts with `id`; MutatorError for none or several."""
        experiment_id = self._find_experiment_id(id)
        return RunExperiment(
            experiment=self.experiments[experiment_id], record=self.records.get(experiment_id), run=self
        )

    def golden(
        self, scenario: str, changes: tuple[str, ...] | None = None, *, seed: int | None = None
    ) -> "pd.DataFrame":
        """Return the golden run of a scenario: one column per channel, indexed by time in s.

        `changes` chooses a variant of the scenario, e.g. `("alone",)`; default: the most frequent. `seed`
        chooses one of several seeds; default: the lowest of the scenario. MutatorError if there is no such
        run.
        """
        scenario_variants = [e.changes for e in self.experiments.values() if e.scenario == scenario]
        if changes is None and scenario_variants:
            # of equally frequent ones, the first of the plan
            changes = max(dict.fromkeys(scenario_variants), key=scenario_variants.count)
        seeds = self.folder.seeds
        seeds_of_scenario = (
            e.seed
            for e in self.experiments.values()
            if e.scenario == scenario and e.changes == (changes or ())
        )
        if seed is not None and seed not in seeds and not self.folder.is_bench:
            raise MutatorError(f"seed {seed}", argument="seed", expected=describe_seeds(seeds))
        selected_seed = min(seeds_of_scenario, default=seeds[0]) if seed is None else seed
        # a run with one seed stores its golden runs without it
        golden_seed = selected_seed if self.folder.has_seeded_goldens else None
        golden_run = GoldenRun(scenario, changes or (), golden_seed)
        folder = self.folder.golden_folder(*golden_run)
        if not folder.is_dir():
            golden_names = stored_golden_keys(self.path / GOLDEN_FOLDER)
            raise MutatorError(
                f"no golden run {golden_run.key}",
                where=self.path,
                expected=describe_choices(golden_names),
            )
        return trace_frame(load_trace(self.manifest, folder), self.manifest)

    def report(self, *, anew: bool = False, single_file: bool = False) -> report_builder.WrittenReport:
        """Write the report, Markdown and one HTML page, unless it is up to date; with `anew`, always.

        With `single_file`, write it always, and also a page into exports/ that contains the replays of the
        worst experiments and works without any other file, so that it can be sent. No experiment is rerun.
        Without a library, the report shows only the results.
        """
        workspace = self._workspace_if_any()
        if not (anew or single_file):
            return report_builder.ensure_report(self.path, workspace)
        results_table.build_tables(self.path)
        return report_builder.write_report(self.path, workspace, single_file=single_file)

    def take_stills(self, progress: ProgressCallback | None = None, *, workers: int = 1) -> str:
        """Rerun the worst camera experiments, and keep the frames at the activation, the first alert and the
        first hazard for the report. At most ten experiments are rerun, and at most one in 20 of those
        planned, `workers` at a time; none is started after two minutes.

        Return the reason for the first experiment without stills; empty if all have stills.
        """
        notify = progress or (lambda _: None)
        return take_stills(self.workspace, self.folder, workers=workers, on_progress=notify)

    def export(
        self,
        format: Format | str,
        out: str | Path | None = None,
        *,
        failures: Sequence[str] = (),
        only: str | None = None,
        table: ExportedTable | str = ExportedTable.RESULTS,
        base: str | Path | None = None,
    ) -> Path:
        """Export the run for other tools, and return the path; default: in exports/ of the run folder.

        `format` is a `Format`, or the name of one that another package adds.
        `failures` are the endings that JUnit shows as failures. `only`, for MCAP, is a filter over the
        columns of the results. `table` is the table for CSV and Parquet. `base`, for SARIF and code quality,
        is an earlier run folder, whose hazards are left out. An MCAP export is a folder of files.
        """
        if table not in (table_names := [choice.value for choice in ExportedTable]):
            raise MutatorError(f"'{table}'", argument="table", expected=f"one of {', '.join(table_names)}")
        exporter = find_export(str(format))
        workspace = self.workspace if exporter.needs_library else None
        if exporter.uses_library:
            workspace = self._workspace_if_any()
        out_path = None if out is None else Path(out)
        parts = ExportSelection(
            failures=failures,
            only=only,
            table=ExportedTable(table),
            base=None if base is None else Path(base),
        )
        return export(self.path, str(format), out_path, workspace=workspace, selection=parts)

    def check_equivalence(self) -> None:
        """Raise CheckFailed if the equivalence check of the run failed."""
        equivalence_check.compare_sample(self.folder, self.folder.records())

    def verify(self, *, rerun: int = 0, expect: str | None = None, repair: bool = False) -> "Audit":
        """Audit the folder: see `mutator.verify`."""
        workspace = self._workspace_if_any()
        from mutator.api.audits import verify

        return verify(self.path, rerun=rerun, expect=expect, repair=repair, workspace=workspace)

    def delete(self) -> None:
        """Delete the run folder; MutatorError if it is in use, or if it holds files that no run writes."""
        run_deletion.delete_run(self.path)

    def finish_deletion(self) -> bool:
        """Finish a deletion that another command has started; return whether the folder is gone."""
        return run_deletion.finish_deletion(self.path)


def scene_if_any(run: Run) -> "dict[str, Any] | None":
    """Return what a replay of the run draws; None without a library that has it."""
    try:
        return scene_as_json(run.workspace.manifest_of(run.folder.head))
    except (MutatorError, KeyError):
        return None


def alerts_note_if_any(run: Run) -> str:
    try:
        return run.alerts_note()
    except (MutatorError, KeyError):  # a note is not worth an error
        return ""
