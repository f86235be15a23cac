"""A run folder: its results as a pandas frame; its experiments, golden runs and faults when asked."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator._common.arguments import check_type
from mutator._common.files import ScratchFolder
from mutator._common.places import run_folders
from mutator._common.tables import Table
from mutator.api.audits import Audit, verify
from mutator.api.experiment_results import ExperimentResult, TraceFrames, describe, trace_frame
from mutator.api.html import facts_html, text_html
from mutator.api.mutants import built
from mutator.api.selection import Bench, WorkspaceLike, open_workspace
from mutator.api.trials import Trial, trial_of
from mutator.campaigns.plans import Plan, load_plan
from mutator.errors import MutatorError
from mutator.execution.merging import merge
from mutator.execution.session import Notify, Summary
from mutator.execution.single_run import rerun
from mutator.execution.traces import Traces
from mutator.exports import Format
from mutator.exports import Table as ExportedTable
from mutator.exports.write import Parts, export
from mutator.model import Experiment, Fault, Record, Status
from mutator.outcomes import results as results_table
from mutator.outcomes import rows as tables
from mutator.outcomes.fault_free import FaultFreeRun, fault_free_runs, own_alerts
from mutator.outcomes.golden import Trace, load_trace
from mutator.outcomes.paths import Path as FaultPath
from mutator.outcomes.paths import Ways, ways_of
from mutator.outcomes.reader import Results
from mutator.outcomes.sampling import keep_series
from mutator.report import building
from mutator.report.film import Shot, film_experiment
from mutator.report.stills import BUDGET_S, stills_due
from mutator.store import cleaning, plan_file
from mutator.store.progress import Pace
from mutator.store.run_folder import RunFolder, golden_key
from mutator.store.series import SeriesFolder
from mutator.store.stretches import Stretch
from mutator.targets.manifest import TargetManifest
from mutator.targets.severity import Scale
from mutator.verification import equivalence
from mutator.verification.seal import not_verifiable, seal_of
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd


def load_run(path: str | Path, *, workspace: WorkspaceLike = None) -> "Run":
    """The run folder at `path`, finished or not. Nothing is read before it is asked for.

    `workspace` is what traces and new reports need: a Workspace, or the folder that holds the library;
    default: found as on the command line, and only when needed. MutatorError when `path` is no run folder.
    """
    return Run(RunFolder.open(Path(path)), None if workspace is None else open_workspace(workspace))


def newest_run(root: Path) -> Path:
    """The run folder in runs/, here or under `root`, that was used last; MutatorError if there is none."""
    found = run_folders(root)
    if not found:
        raise MutatorError(
            "no run folder in runs/",
            argument="run",
            remedy="name one: `run`, or make one: `mutator run quickstart --out runs/first`",
        )
    return _from_here(found[0])


def _from_here(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def merge_runs(shards: Sequence[str | Path], out: str | Path, *, accept_versions: bool = False) -> "Run":
    """Merge the shards of a plan into the run folder `out`: the one that a single machine would have made.

    MutatorError for shards that are not one plan's, whole and finished, and, unless `accept_versions`, for
    some driven with another Python or other packages; CheckFailed when their fault-free runs differ.
    """
    if isinstance(shards, str | Path):
        raise MutatorError(repr(str(shards)), argument="shards", expected="a list of run folders")
    merge([Path(shard) for shard in shards], Path(out), accept_versions=accept_versions)
    return load_run(out)


@dataclass(frozen=True, eq=False, repr=False)
class Run:
    """A run folder, read when asked. `summary` is what `mutator.run` came to; None for a loaded run."""

    folder: RunFolder
    given_workspace: Workspace | None = None
    summary: Summary | None = None

    def __repr__(self) -> str:
        head = self.folder.head
        done = f"{sum(self.endings.values())} of {self.folder.planned} experiments"
        failed = len(self.harness_errors)
        errors = f", {failed} with a HARNESS ERROR" if failed else ""
        old = "" if self.verifiable else f", {not_verifiable(self.folder)}"
        return f"<Run {self.path.name}: {done} of {head['campaign']}, {head['reading']}{errors}{old}>"

    def _repr_html_(self) -> str:
        note = known_alerts_note(self)
        parts = text_html(repr(self)), facts_html(self.endings.items()), self.counts().as_html()
        return "".join(map(str, (*parts, text_html(note) if note else "")))

    @property
    def path(self) -> Path:
        """The folder."""
        return self.folder.path

    @cached_property
    def workspace(self) -> Workspace:
        """Library, templates and target that the run is looked at with."""
        return self.given_workspace or Workspace.find()

    @cached_property
    def _bench(self) -> Bench:
        """The run's target in that workspace."""
        return Bench.of(self.workspace, self.folder.head["target"])

    @property
    def provenance(self) -> dict[str, Any]:
        """Campaign, target, seed, reading and choices; digests of the sources; what each stretch of work ran
        with, under `stretches`."""
        head = self.folder.head
        keys = ("campaign", "target", "plan", "choices", "limits")
        return {key: head[key] for key in keys} | self.folder.provenance

    @cached_property
    def plan(self) -> Plan:
        """The frozen plan."""
        return load_plan(self.folder)

    @cached_property
    def faults(self) -> dict[str, Fault]:
        """The planned faults by id: value, aim, and what is injected where."""
        return plan_file.read_faults(self.path)

    @cached_property
    def experiments(self) -> dict[str, Experiment]:
        """The planned experiments by id, in the plan's order."""
        return {e.id: e for e in plan_file.read_all(self.path)}

    @cached_property
    def records(self) -> Mapping[str, Record]:
        """The record of each experiment that has one, by id."""
        return self.folder.records()

    @cached_property
    def results(self) -> "pd.DataFrame":
        """A row per experiment that has a record, by experiment id: the columns of results.csv, typed.

        As `mutator.outcomes.reader.Results.frame` makes it; the table is brought up to date first.
        """
        return Results.up_to_date(self.path).frame()

    def propagation(self) -> "pd.DataFrame":
        """A row for each channel of an experiment that left golden: the columns of propagation.parquet.

        The table is brought up to date first. MutatorError for a run of a version that recorded none.
        """
        return Results.up_to_date(self.path).propagation()

    @property
    def endings(self) -> dict[str, int]:
        """How many experiments ended how: outcomes of those that ended well, statuses of the others."""
        return tables.outcome_counts(self._rows)

    @property
    def harness_errors(self) -> dict[str, str]:
        """Experiments that the harness failed at, and why; `mutator.run` tries them again."""
        return {r.experiment_id: r.detail for r in self._rows if r.status is Status.HARNESS_ERROR}

    @property
    def verifiable(self) -> bool:
        """Whether its content can be verified; runs of earlier schemas have no digests."""
        return self.folder.verifiable

    @cached_property
    def seal(self) -> str | None:
        """One digest of everything that counts, computed now; None for a run that is not finished, or not
        verifiable."""
        return seal_of(self.folder)

    def counts(self) -> Table:
        """How the experiments of each fault type ended."""
        hazards = tables.hazard_names(self._rows)
        counts = tables.counts_by(self._rows, tables.by_fault_type)
        heads, rows = tables.count_table(counts, "fault type", hazards, alerts=self.folder.has_alerts)
        return Table(heads=heads, rows=rows, right=range(1, len(heads)))

    def fault_free(self) -> tuple[FaultFreeRun, ...]:
        """What the golden runs do by themselves: alerts, hazards, and how far each plotted channel goes."""
        return fault_free_runs(self.folder, self._bench.manifest)

    def alerts_note(self) -> str:
        """Which alerts the fault-free runs raise, too, as a sentence; empty if none."""
        return own_alerts(self.fault_free())

    def experiment(self, id: str) -> "RunExperiment":
        """The planned experiment whose id is `id` or starts so; MutatorError for none or several."""
        check_type("id", id, str, "the id of an experiment, or the start of one")
        wanted = self.folder.find(id)
        return RunExperiment(experiment=self.experiments[wanted], record=self.records.get(wanted), run=self)

    def golden(self, scenario: str, changes: tuple[str, ...] | None = None) -> "pd.DataFrame":
        """The fault-free run of a scenario: a column per channel, by time in s.

        `changes` of the scenario tell apart what was driven in several ways, `("alone",)`; default: those
        of most experiments. MutatorError for one that was not driven.
        """
        driven = [e.changes for e in self.experiments.values() if e.scenario == scenario]
        if changes is None and driven:
            changes = max(dict.fromkeys(driven), key=driven.count)
        folder = self.folder.golden(scenario, changes or ())
        if not folder.is_dir():
            known = sorted(path.name for path in (self.path / "golden").glob("*"))
            raise MutatorError(
                f"no golden run {golden_key(scenario, changes or ())}",
                where=self.path,
                expected=f"one of {', '.join(known) or 'none'}",
            )
        return trace_frame(load_trace(self._bench.manifest, folder), self._bench.manifest)

    def report(self, *, anew: bool = False) -> building.Report:
        """Write the report, Markdown and one HTML page, unless it is up to date.

        `anew` writes it at any rate. No experiment is driven for it. Where no library is found, the results
        stand alone.
        """
        workspace = self._workspace_if_any()
        if not anew:
            return building.ensure(self.path, workspace)
        results_table.build(self.path)
        return building.write(self.path, workspace)

    def take_stills(self, progress: Notify | None = None) -> str:
        """Drive the worst few experiments that see pictures again, and keep what the camera saw at the
        activation, the first alert and the first hazard: the report shows it. At most ten experiments, one
        of 20 that are planned, and none is begun after two minutes.

        Returns why the first one that has no pictures has none; empty if there is no such.
        """
        due, problem = stills_due(self.folder, self._bench.manifest), ""
        pace, began = Pace("pictures", len(due)), time.monotonic()
        for i, (name, shots) in enumerate(due.items()):
            if time.monotonic() - began > BUDGET_S:
                break
            if progress:
                progress(pace.at(i))
            try:
                same = self.experiment(name).film(shots)
                wrong = "" if same else "driven again it is not what the campaign found"
            except MutatorError as error:
                wrong = str(error)
            problem = problem or (f"{name}: {wrong}" if wrong else "")
        return problem

    def export(
        self,
        format: Format | str,
        out: str | Path | None = None,
        *,
        failures: Sequence[str] = (),
        only: str | None = None,
        table: ExportedTable | str = ExportedTable.RESULTS,
    ) -> Path:
        """Write the run for other tools; default: a file in exports/ of the run folder, which is returned.

        `failures` are the endings that JUnit shows as failures, `only` is a filter over the columns of the
        results for MCAP, which is a folder of files, `table` what CSV and Parquet are of.
        """
        for name, value, kind in (("format", format, Format), ("table", table, ExportedTable)):
            if value not in (known := [one.value for one in kind]):
                raise MutatorError(f"'{value}'", argument=name, expected=f"one of {', '.join(known)}")
        wanted = Format(format)
        workspace = self.workspace if wanted is Format.MUTATION_ELEMENTS else None
        if wanted is Format.MCAP:
            workspace = self._workspace_if_any()
        place = None if out is None else Path(out)
        parts = Parts(failures=failures, only=only, table=ExportedTable(table))
        return export(self.path, wanted, place, workspace=workspace, parts=parts)

    def check_equivalence(self) -> None:
        """CheckFailed when a sample that was run again on the reference engine gave another result."""
        equivalence.judge(self.folder, self.folder.records())

    def verify(self, *, rerun: int = 0, expect: str | None = None, repair: bool = False) -> Audit:
        """Audit the folder: see `mutator.verify`."""
        workspace = self._workspace_if_any()
        return verify(self.path, rerun=rerun, expect=expect, repair=repair, workspace=workspace)

    def delete(self) -> None:
        """Delete the run folder; MutatorError while a command or its workers hold it, and when it holds what
        no run writes."""
        cleaning.clean(self.path)

    def finish_deletion(self) -> bool:
        """Wait for a command that may be deleting the folder, and finish its work; whether it is gone."""
        return cleaning.finish_deletion(self.path)

    def _workspace_if_any(self) -> Workspace | None:
        try:
            return self.workspace
        except MutatorError:
            return None

    @cached_property
    def _rows(self) -> tuple[tables.Row, ...]:
        return Results.up_to_date(self.path).rows()

    @cached_property
    def _ways(self) -> Ways | None:
        return ways_of(self.folder.head)

    @cached_property
    def _traces(self) -> Traces:
        """Traces that are kept in the run folder, and those that are driven when needed."""
        return Traces(self.workspace, self.folder)


def known_alerts_note(run: Run) -> str:
    """The run's `alerts_note`; empty, too, where its target or its golden runs cannot be read here."""
    try:
        return run.alerts_note()
    except (MutatorError, KeyError):
        return ""


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class RunExperiment(ExperimentResult):
    """An experiment of a run."""

    run: Run

    @cached_property
    def patch(self) -> str:
        """The whole patch, probe included: the kept one, or made now when it has not run yet."""
        kept = self.run.folder.read_patch(self.id, self.record)
        if kept is not None:
            return kept.decode("utf-8", "surrogateescape")
        return built(self.run._bench, self.fault, self.experiment.trigger).patch

    @property
    def scale(self) -> Scale | None:
        """The scale of severity that the run was planned with."""
        return self.run.folder.scale

    def traces(self, *, exact: bool = False) -> TraceFrames:
        """Golden and faulty run as pandas frames.

        They are the experiment's series: the manifest's channels, at most 20 values a second (10 of what the
        controller believes), to six digits; a value is the newest one at its time, so what lasts for
        less may be missed. With `exact` it is driven again, which takes as long as one run: all channels in
        every step. So is one that has no series (left out under the budget, or of an earlier version), whose
        series is then kept. MutatorError when it has not run yet, and, where it is driven, when target,
        templates or scenario have changed since, or another result comes out than the campaign's.
        """
        if exact:
            trial = self.rerun(keep=True)
            if trial.same_as_record is False:
                raise MutatorError(
                    f"{self.id} driven again is not what the campaign found", where=self.run.path
                )
            return trial.traces()
        if self.record is None:
            raise self.not_run()
        golden, faulty = self.run._traces.sampled(self.id, drive=True)
        manifest = self._target()
        return TraceFrames(golden=trace_frame(golden, manifest), faulty=trace_frame(faulty, manifest))

    def rerun(self, *, keep: bool = False) -> Trial:
        """Drive it again; `Trial.same_as_record` says whether the record is the campaign's.

        With `keep` its trace, its series and its plot stay in the run folder. MutatorError
        when target, templates or scenario have changed since.
        """
        run, folder = self.run, self.run.folder
        temporary = None if keep else ScratchFolder("mutator-rerun-")
        out = temporary.path / self.id if temporary else None
        single, same = rerun(run.workspace, folder.path, self.id, out=out)
        manifest = run._bench.manifest
        trial = trial_of(
            single,
            manifest,
            scale=self.scale,
            same_as_record=same if self.record else None,
            temporary=temporary,
        )
        if keep and trial.save_plot(self.plot_file) and same:  # only what the record is of
            golden, faulty = (load_trace(manifest, place) for place in (single.golden, single.faulty))
            keep_series(folder.path, manifest, golden, faulty, single.record)
        return trial

    def film(self, shots: Sequence[Shot]) -> bool:
        """Drive golden and faulty run again and write videos or stills of them; is the record the campaign's?

        MutatorError for a target that cannot be filmed, and a faulty run that left no film.
        """
        run, facts = self.run, describe(self.experiment)
        trigger = facts["trigger"].removesuffix(": True")
        title = f"{facts['fault']}   {facts['scenario']}   {trigger}"
        return film_experiment(run.workspace, run._bench.manifest, run.path, self.id, title, shots)

    @property
    def stretch(self) -> Stretch | None:
        """What it was run with; None before it was run."""
        return self.run.folder.stretch_of(self.id)

    @property
    def plot_file(self) -> Path:
        """Where the run folder keeps its plot."""
        return self.run.path / "plots" / f"{self.id}.svg"

    @property
    def is_drawn(self) -> bool:
        """Whether the run folder has its plot and its series."""
        return self.plot_file.exists() and SeriesFolder(self.run.path).has(self.id)

    def not_run(self) -> MutatorError:
        """What to say of an experiment that is only planned."""
        campaign, out = self.run.folder.head["campaign"], _from_here(self.run.path)
        return MutatorError(
            f"experiment {self.id} has not run yet",
            where=self.run.path,
            remedy=f"run it: `mutator run {campaign} --out {out}`",
        )

    @property
    def fault_path(self) -> FaultPath | None:
        """How far its fault got along the control structure; None where that is not known, and for a fault
        that was never active or a run without an outcome."""
        ways = self.run._ways
        return ways.path(self.experiment, self.record) if ways and self.record else None

    def _channels(self) -> Sequence[Sequence[str]]:
        channels: Sequence[Sequence[str]] = self.run.folder.head.get("channels", ())
        return channels

    def _target(self) -> TargetManifest:
        return self.run._bench.manifest

    def _load_traces(self) -> tuple[Trace, Trace]:
        if self.record is None:
            raise self.not_run()
        return self.run._traces.of(self.id)
