"""A bench: a run folder that stays open, and answers one list of experiments after another.

Its workers stay between batches, with their fork servers and golden runs. Its plan grows with each batch.
"""

import os
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import remove_anything_at, remove_folder, write_atomic
from mutator._common.folder_locks import lock_run_folder
from mutator._common.interrupts import delaying_interrupts, raising_keyboard_interrupts
from mutator.campaigns.bench_files import bench_file_bytes, load_bench_file
from mutator.campaigns.campaign_expansion import CampaignExpansion
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.plan_freezing import make_run_folder
from mutator.campaigns.plan_growth import APPENDED_FILES, GrowingPlan
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import accepted_version_differences, check_sources, check_version
from mutator.campaigns.shared_runs import group_by_run, order_for_sharing
from mutator.engines.engine_choice import choose_engine
from mutator.engines.engine_kinds import REFERENCE
from mutator.engines.job_folder import ensure_work_folder
from mutator.errors import MutatorError
from mutator.execution.batch_check import BatchCheck
from mutator.execution.bench_crew import BenchCrew
from mutator.execution.bench_messages import BenchWorkerStart
from mutator.execution.session import Session
from mutator.execution.session_summary import Summary
from mutator.execution.worker import WorkerAssignment
from mutator.model import AfterHazard, Experiment, Record, Status
from mutator.preflight import equivalence_check
from mutator.preflight.bench_checks import BenchChecks
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store import file_digests
from mutator.store.appended_files import undo_unfinished_growth
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.preflight_results import golden_digests
from mutator.store.run_folder import GoldenRun, RunFolder
from mutator.store.run_head import CAMPAIGN_FILE
from mutator.targets.manifest import TargetManifest
from mutator.targets.required_packages import check_requirements
from mutator.workspace import Workspace

_P = ParamSpec("_P")
_R = TypeVar("_R")


def _one_caller_at_a_time(
    method: Callable[Concatenate["Bench", _P], _R],
) -> Callable[Concatenate["Bench", _P], _R]:
    @wraps(method)
    def call(bench: "Bench", /, *args: _P.args, **keywords: _P.kwargs) -> _R:
        if not bench.caller_lock.acquire(blocking=False):
            raise MutatorError(
                "another call is running",
                where=bench.path,
                expected="one caller of a bench at a time",
                remedy="wait for it, or open another bench in another folder",
            )
        try:
            with raising_keyboard_interrupts():
                return method(bench, *args, **keywords)
        finally:
            bench.caller_lock.release()

    return call


class Bench:
    """An open bench. The caller owns the run folder, whose `campaign.yaml` is the file of `campaign`."""

    def __init__(
        self,
        workspace: Workspace,
        manifest: TargetManifest,
        campaign: Campaign,
        canary: Experiment | None,
        path: Path,
        *,
        workers: int = 1,
        engine: str | None = None,
    ) -> None:
        self.path = path.resolve()
        self.caller_lock = threading.Lock()
        self._workspace, self._manifest = workspace, manifest
        check_requirements(manifest)
        self._requested_engine, self._engine = engine, choose_engine(engine, manifest)
        self._batch_check = BatchCheck(workspace, manifest, campaign)
        self._plan = GrowingPlan(workspace, manifest, campaign, canary, self.path)
        self._checks = BenchChecks(workspace, manifest, campaign, canary, self.path / "work", workers=workers)
        self._stored_records: Mapping[str, Record] = {}
        self._new_records: dict[str, Record] = {}
        self._session: Session | None = None
        self._worker_prefix, self._has_begun = "", False
        self._is_plan_half_written = False
        self.summary: Summary | None = None  # known once the bench is closed
        self._crew = BenchCrew(workers, self._start_of_worker, self._note_written)
        if RunFolder.exists(self.path):
            self._resume()

    @property
    def after_hazard(self) -> AfterHazard:
        return self._plan.campaign.after_hazard

    @property
    def experiment_count(self) -> int:
        """The number of planned experiments."""
        return len(self._plan.ids)

    @property
    def pending(self) -> tuple[Experiment, ...]:
        """Planned experiments without a final record: they were cut off, or the harness failed."""
        if self._session is None:
            return ()
        planned = PlannedExperiments(self.path)
        return tuple(planned[name] for name in planned if not self._has_final_record(name))

    @_one_caller_at_a_time
    def run(self, experiments: Sequence[Experiment], reason: str = "") -> list[Record]:
        """Return the record of each experiment, in order.

        An experiment that has a record is not run again, unless the harness failed. `reason` is kept with the
        batch. MutatorError for an experiment that does not fit the bench, for a source that was edited while
        it was open, and if a worker fails; CheckFailed if a golden run fails its checks. Nothing of the batch
        is then planned, except after the failure of a worker.
        """
        batch = self._batch_check.check(experiments)
        self._plan_new([e for e in batch.values() if e.id not in self._plan.ids], reason)
        self._obtain_records(list(batch.values()))
        return [self._records_by_id(experiment.id) for experiment in experiments]

    @_one_caller_at_a_time
    def prove(self) -> EquivalenceResult | None:
        """Run again, on the reference engine, what the final sample contains of the experiments so far.

        None if no experiment was forked. CheckFailed if a record differs.
        """
        return self._prove()

    def finish(self) -> Summary | None:
        """Prove the bench if all planned experiments have a record, and write tables, seal and series.

        None if nothing was ever planned.
        """
        if self._session is None:
            return None
        if not self.pending:
            self._prove()
        self._crew.close()
        return self._session.finish()

    def stop_work(self) -> None:
        """End all workers at once, for example after Ctrl-C. The next call starts new ones."""
        self._crew.kill()
        if self._session is not None:
            self._read_records()

    def _resume(self) -> None:
        folder = RunFolder(self.path)
        for golden_run in self._plan.golden_runs:
            self._batch_check.note_scenario(golden_run.scenario)
        self._checks.read(self.path, self._plan.golden_runs)
        self._session = self._open_session(folder)
        self._read_records()

    def _open_session(self, folder: RunFolder) -> Session:
        session = Session(self._workspace, folder, workers=self._crew.size, engine=self._requested_engine)
        self._worker_prefix = session.new_worker_name("")
        return session

    def _read_records(self) -> None:
        self._stored_records, self._new_records = RunFolder(self.path).records(), {}

    def _plan_new(self, experiments: Sequence[Experiment], reason: str) -> None:
        """Check what is new, and add it to the plan."""
        if self._is_plan_half_written:
            raise MutatorError(
                "the plan could not be written",
                where=self.path,
                remedy="close this bench, and open it again: what has finished is not repeated",
            )
        if not experiments and self._session is None:
            return
        self._checks.check_anchors(experiment.fault for experiment in experiments)
        if self._session is not None:
            self._session.check_ledger()
        ensure_work_folder(self.path / "work")
        new_goldens = self._checks.check_goldens(self._plan.golden_runs_with(experiments))
        if not experiments and not new_goldens:
            return
        self._is_plan_half_written = True
        with delaying_interrupts():
            self._write_growth(experiments, reason, new_goldens)
        self._is_plan_half_written = False

    def _write_growth(
        self, experiments: Sequence[Experiment], reason: str, new_goldens: Sequence[GoldenRun]
    ) -> None:
        if experiments:
            folder = self._plan.append(experiments, reason)
            self._session = self._session or self._open_session(folder)
        assert self._session is not None
        if new_goldens:
            limits = RunFolder(self.path).limits
            self._checks.store(self.path, self._plan.golden_runs, new_goldens, len(self._plan.variants))
            if RunFolder(self.path).limits != limits:  # workers have the limits with which they began
                self._crew.close()
        self._session.note_growth(RunFolder(self.path))

    def _obtain_records(self, experiments: Sequence[Experiment]) -> None:
        """Get a record of each planned experiment. This is the one place where records come from."""
        missing = [experiment for experiment in experiments if not self._has_final_record(experiment.id)]
        if not missing:
            return
        self._new_records |= self._run_by_crew(missing)

    def _prove(self) -> EquivalenceResult | None:
        if self._session is None:
            return None
        folder = self._session.folder
        planned = PlannedExperiments(self.path)
        sampled = equivalence_check.remaining_sampled_experiments(folder)
        experiments = [planned[s.id] for s in sampled if self._has_final_record(s.id)]
        if experiments:
            self._run_by_crew(experiments, is_proof=True)
        return equivalence_check.compare_sample(folder, folder.records())

    def _begin_work(self) -> None:
        """Before the first run of this opening: record the software and the machine."""
        assert self._session is not None
        if self._engine != REFERENCE:
            equivalence_check.mark_check_as_needed(self.path)
        if not self._has_begun:
            self._session.begin_environment(f"{self._worker_prefix}*")
            self._has_begun = True

    def _run_by_crew(self, experiments: Sequence[Experiment], *, is_proof: bool = False) -> dict[str, Record]:
        assert self._session is not None
        self._begin_work()
        runs = order_for_sharing(group_by_run(self._manifest, experiments))
        digests = golden_digests(self._session.folder)
        files = self._batch_check.scenario_files
        try:
            records = self._crew.run(runs, digests, files, is_proof=is_proof)
            return {record.experiment_id: record for record in records}
        except BaseException:
            self._crew.kill()
            self._read_records()  # what has finished stays
            raise

    def _start_of_worker(self, number: int) -> BenchWorkerStart:
        assert self._session is not None
        name = f"{self._worker_prefix}w{number}"
        self._session.written.note_worker_began(name)
        inputs = RunInputs.from_workspace(self._workspace, self._manifest, self._session.folder.scenarios)
        return BenchWorkerStart(
            inputs=inputs.to_bytes(),
            assignment=WorkerAssignment(
                run_folder=self.path,
                worker_name=name,
                engine=self._engine,
                golden_digests={},
                secret=self._session.secret,
                parent_pid=os.getpid(),
            ),
        )

    def _note_written(self, worker: str, written: Mapping[str, str]) -> None:
        assert self._session is not None
        self._session.written.add_report(written, worker)

    def _has_final_record(self, experiment_id: str) -> bool:
        record = self._new_records.get(experiment_id) or self._stored_records.get(experiment_id)
        return record is not None and record.status is not Status.HARNESS_ERROR

    def _records_by_id(self, experiment_id: str) -> Record:
        return self._new_records.get(experiment_id) or self._stored_records[experiment_id]


@contextmanager
def opened_bench(
    workspace: Workspace,
    out: Path,
    values: Mapping[str, Any],
    *,
    workers: int = 1,
    engine: str | None = None,
) -> Iterator[Bench]:
    """Lock the run folder `out`, open the bench in it or begin one, and finish it at the end of the block.

    `values` are those of `bench_files.BenchModel`. An error in the block leaves the run unfinished: it can be
    opened again.
    """
    is_new = not out.exists()
    make_run_folder(out)
    with lock_run_folder(out):
        try:
            bench = _build_bench(workspace, out, values, workers=workers, engine=engine)
            try:
                yield bench
            except BaseException:
                bench.stop_work()
                raise
            bench.summary = bench.finish()
        finally:
            remove_anything_at(out / "work")
            if RunFolder.exists(out):
                file_digests.add_segments_to_ledger(out)
    if is_new and not RunFolder.exists(out):  # nothing was planned, so nothing is worth keeping
        remove_folder(out)


def _build_bench(
    workspace: Workspace, out: Path, values: Mapping[str, Any], *, workers: int, engine: str | None
) -> Bench:
    file_bytes = bench_file_bytes(values)
    if RunFolder.exists(out):
        _check_existing(workspace, out, file_bytes)
    else:
        write_atomic(out / CAMPAIGN_FILE, file_bytes)
    campaign = load_bench_file(out / CAMPAIGN_FILE)
    manifest = workspace.manifest(campaign.target)
    expansion = CampaignExpansion(workspace, campaign, manifest, campaign.seed, campaign.reading or "")
    return Bench(workspace, manifest, campaign, expansion.build_canary(), out, workers=workers, engine=engine)


def _check_existing(workspace: Workspace, out: Path, file_bytes: bytes) -> None:
    """Undo what a killed command left half done; MutatorError unless `out` is this bench's run folder."""
    undo_unfinished_growth(out, APPENDED_FILES)
    folder = RunFolder.open(out)
    if not folder.is_bench:
        raise MutatorError(
            f"holds a run of campaign '{folder.head.campaign}'",
            where=out,
            argument="out",
            expected="a bench's run folder, or a new or empty folder",
            remedy="choose another folder",
        )
    check_version(folder)
    if read_bounded(out / CAMPAIGN_FILE) != file_bytes:
        raise MutatorError(
            "this bench was opened with other arguments",
            where=out / CAMPAIGN_FILE,
            expected="the same target, canary, limits, seed and reading each time",
            remedy="give the same arguments, or choose another folder",
        )
    accepted_version_differences(folder)
    current = RunInputs.from_workspace(workspace, workspace.manifest(folder.head.target), folder.scenarios)
    check_sources(out, folder.head.sources, current.digest_by_source())
    file_digests.add_segments_to_ledger(out)
    remove_anything_at(folder.scratch_folder)
