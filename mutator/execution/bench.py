"""A bench: a run folder that stays open, and answers one list of experiments after another.

Its workers stay between batches, with their fork servers and golden runs. Its plan grows with each batch, in
the order in which batches are asked for. Several batches can be in flight.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.interrupts import delaying_interrupts
from mutator.campaigns.campaign_files import Campaign
from mutator.campaigns.plan_growth import APPENDED_FILES, GrowingPlan
from mutator.campaigns.shared_runs import group_by_run, order_for_sharing
from mutator.engines.engine_choice import choose_engine
from mutator.engines.engine_kinds import REFERENCE
from mutator.engines.job_folder import ensure_work_folder
from mutator.errors import MutatorError
from mutator.execution.awaited_records import AwaitedRecords
from mutator.execution.batch_check import BatchCheck, check_reason
from mutator.execution.bench_calls import BenchCalls
from mutator.execution.bench_crew import BenchCrew, CrewBatch
from mutator.execution.bench_progress import BenchProgress
from mutator.execution.distributed_crew import DistributedCrew
from mutator.execution.earlier_benches import EarlierBenches
from mutator.execution.session import Session
from mutator.execution.session_summary import Summary
from mutator.execution.worker import WorkerStart
from mutator.model import AfterHazard, Experiment, Record, Status
from mutator.preflight import equivalence_check
from mutator.preflight.bench_checks import BenchChecks
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store import file_digests
from mutator.store.appended_files import undo_unfinished_growth
from mutator.store.golden_runs import GoldenRun
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.planned_scenarios import PlannedScenarios
from mutator.store.preflight_results import golden_digests
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import ProgressCallback
from mutator.targets.manifest import TargetManifest
from mutator.targets.required_packages import check_requirements
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from mutator.execution.distributor_choice import Distributor


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
        notify: ProgressCallback = lambda progress: None,
        reuse: bool = True,
        distributor: "Distributor | None" = None,
        earlier: EarlierBenches | None = None,
    ) -> None:
        self._earlier = earlier or EarlierBenches()
        self.path = path.resolve()
        self.calls = BenchCalls(self.path)
        workspace = replace(workspace, planned_scenarios=PlannedScenarios(self.path))
        self._workspace, self._manifest = workspace, manifest
        check_requirements(manifest)
        self._requested_engine, self._engine = engine, choose_engine(engine, manifest)
        self._is_reuse_wanted = reuse and distributor is None
        self._batch_check = BatchCheck(workspace, manifest, campaign)
        self._plan = GrowingPlan(workspace, manifest, campaign, canary, self.path)
        self._checks = BenchChecks(
            workspace,
            manifest,
            campaign,
            canary,
            self.path / "work",
            workers=workers,
            notify=notify,
            passed_goldens=self._earlier.passed_goldens,
        )
        self._stored_records: Mapping[str, Record] = {}
        self._new_records: dict[str, Record] = {}
        self._awaited = AwaitedRecords()
        self._session: Session | None = None
        self._has_begun = False
        self._is_plan_half_written = self._has_crew_old_limits = False
        self.summary: Summary | None = None  # known once the bench is closed
        self._progress = BenchProgress(notify)
        self._crew: BenchCrew | DistributedCrew = (
            DistributedCrew(distributor, workers, self._begun_session, self._progress.note_record)
            if distributor
            else BenchCrew(workers, self._start_of_worker, self._note_written, self._progress.note_record)
        )
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

    def run(self, experiments: Iterable[Experiment], reason: str = "") -> list[Record]:
        """Return the record of each experiment, in order.

        An experiment that has a record is not run again, unless the harness failed. `reason` is kept with the
        batch. MutatorError for an experiment that does not fit the bench, for a source that was edited while
        it was open, and if a worker fails; CheckFailed if a golden run fails its checks. Nothing of the batch
        is then planned, except after the failure of a worker.
        """
        with self._calling():
            batch = self._begin_batch(experiments, reason)
            self._receive_records({experiment.id for experiment in batch})
            return [self._records_by_id(experiment.id) for experiment in batch]

    def plan(self, experiments: Iterable[Experiment], reason: str = "") -> Session:
        """Check and plan a batch as `run` does, for others who run it; return their session."""
        with self._calling():
            batch = self._check_batch(experiments, reason)
            self._plan_new(batch, reason)
            session = self._begin_work()
            session.find_work()
            return session

    def submit(self, experiments: Iterable[Experiment], reason: str = "") -> None:
        """Plan a batch as `run` does, and return while it runs: `results` gives its records."""
        with self._calling():
            batch = self._begin_batch(experiments, reason)
            self._awaited.request(experiment.id for experiment in batch)

    def results(self) -> Iterator[Record]:
        """Yield the records of all submitted batches as they come, until none is in flight.

        An experiment has a record for each time it was submitted. MutatorError if a worker fails; like after
        an interruption, nothing is then in flight, and `pending` has what did not finish.
        """
        while (experiment_id := self._next_result()) is not None:
            yield self._records_by_id(experiment_id)

    def prove(self) -> EquivalenceResult | None:
        """Run again, on the reference engine, what the final sample contains of the experiments so far, once
        no batch is in flight.

        None if no experiment was forked. CheckFailed if a record differs.
        """
        with self._calling():
            return self._prove()

    def checked_golden_folders(self, experiments: Iterable[Experiment]) -> Mapping[GoldenRun, Path]:
        """Check the golden runs of experiments without planning these; where each is until the next call."""
        with self._calling():
            golden_runs = self._plan.golden_runs_with(self._check_batch(experiments, ""))
            return self._checks.checked_folders(self.path, golden_runs)

    def finish(self) -> None:
        """Close the bench: prove it if all planned experiments have a record, and write tables, seal and
        series. A call of another thread ends first.
        """
        with self.calls.closing():
            self._check_plan_is_whole()
            if self._session is None:
                return
            self._receive_records(self._awaited.running)
            if not self.pending:
                self._prove()
            self._crew.close()
            self.summary = self._session.finish()

    def abandon(self) -> None:
        """Close the bench after an error: end all workers at once. A call of another thread fails first."""
        self.calls.refuse()
        self._crew.stop()
        with self.calls.closing():
            self._crew.kill()

    @contextmanager
    def _calling(self) -> Iterator[None]:
        """Make a call, whose interruption ends all work."""
        with self.calls.calling():
            try:
                yield
            except KeyboardInterrupt:
                self._stop_work()
                raise

    def _begin_batch(self, experiments: Iterable[Experiment], reason: str) -> list[Experiment]:
        """Check, plan and hand out a batch; return its experiments."""
        batch = self._check_batch(experiments, reason)
        self._plan_new(batch, reason)
        self._hand_out_missing(batch)
        return batch

    def _check_batch(self, experiments: Iterable[Experiment], reason: str) -> list[Experiment]:
        check_reason(reason)
        return self._batch_check.check(experiments)

    def _next_result(self) -> str | None:
        with self._calling():
            while (experiment_id := self._awaited.next_arrived()) is None and self._awaited.is_any_requested:
                self._receive_record()
            return experiment_id

    def _receive_records(self, experiment_ids: Set[str]) -> None:
        """Wait until none of these experiments runs."""
        while self._awaited.running & experiment_ids:
            self._receive_record()

    def _receive_record(self) -> None:
        record = self._receive()
        self._new_records[record.experiment_id] = record
        self._awaited.note_record(record.experiment_id)

    def _receive(self) -> Record:
        try:
            return self._crew.receive()
        except MutatorError:
            self._stop_work()
            raise

    def _stop_work(self) -> None:
        """End all workers. What has finished stays."""
        with delaying_interrupts():  # after half of it, the next call would wait for ever
            self._crew.kill()
            if self._session is not None:
                self._read_records()
            self._awaited.stop(self._has_final_record)

    def _resume(self) -> None:
        for golden_run in self._plan.golden_runs:
            self._batch_check.note_scenario(golden_run.scenario, self._plan.family_of(golden_run.scenario))
        self._checks.read(self.path, self._plan.golden_runs)
        self._session = self._open_session(RunFolder(self.path))
        self._read_records()
        self._session.note_stored(self._stored_records)
        self._progress.note_stored(self._stored_records.values())
        self._progress.note_planned(self.experiment_count)

    def _open_session(self, folder: RunFolder) -> Session:
        return Session(
            self._workspace,
            folder,
            workers=self._crew.size,
            engine=self._requested_engine,
            notify=self._progress.notify,
            reuse=self._is_reuse_wanted,
            earlier=self._earlier.session_use,
        )

    def _read_records(self) -> None:
        self._stored_records, self._new_records = RunFolder(self.path).records(), {}

    def _plan_new(self, batch: Sequence[Experiment], reason: str) -> None:
        """Check what is new in a batch, and add it to the plan."""
        self._check_plan_is_whole()
        experiments = [e for name, e in {e.id: e for e in batch}.items() if name not in self._plan.ids]
        if not experiments and self._session is None:
            return
        self._checks.check_anchors(experiment.fault for experiment in experiments)
        if self._session is not None:
            self._session.check_own_files()
        ensure_work_folder(self.path / "work")
        new_goldens = self._checks.check_goldens(self._plan.golden_runs_with(experiments))
        if not experiments and not new_goldens:
            return
        self._crew.wait_until_ready()  # a worker that begins reads what is now written
        with delaying_interrupts():
            self._is_plan_half_written = True
            try:
                self._write_growth(experiments, reason, new_goldens)
            except BaseException:
                self._undo_growth()
                self._is_plan_half_written = False
                raise
            self._is_plan_half_written = False

    def _check_plan_is_whole(self) -> None:
        if self._is_plan_half_written:
            raise MutatorError(
                "the plan could not be written",
                where=self.path,
                remedy="open this bench again: what has finished is not repeated",
            )

    def _undo_growth(self) -> None:
        """Go back to what the run folder had before a batch that could not be added, for example because the
        disk is full.
        """
        if RunFolder.exists(self.path):
            undo_unfinished_growth(self.path, APPENDED_FILES)
            file_digests.save_ledger(self.path, file_digests.settled_ledger(self.path))
            folder = RunFolder(self.path)
            self._session = self._session or self._open_session(folder)
            self._session.note_own_files(folder)
        self._plan = self._plan.read_again()

    def _write_growth(
        self, experiments: Sequence[Experiment], reason: str, new_goldens: Sequence[GoldenRun]
    ) -> None:
        if experiments:
            folder = self._plan.append(experiments, reason)
            self._session = self._session or self._open_session(folder)
        assert self._session is not None
        if new_goldens:
            limits = RunFolder(self.path).limits
            self._checks.store(self.path, self._plan.golden_runs, new_goldens)
            self._has_crew_old_limits |= RunFolder(self.path).limits != limits
        self._session.note_growth(RunFolder(self.path))
        self._progress.note_planned(self.experiment_count)

    def _hand_out_missing(self, experiments: Sequence[Experiment]) -> None:
        """Give the crew the planned experiments that have no record and do not run yet."""
        missing = {
            experiment.id: experiment
            for experiment in experiments
            if not self._has_final_record(experiment.id) and experiment.id not in self._awaited.running
        }
        if missing:
            self._hand_out(list(missing.values()))

    def _prove(self) -> EquivalenceResult | None:
        if self._session is None:
            return None
        self._receive_records(self._awaited.running)
        folder = self._session.folder
        planned = PlannedExperiments(self.path)
        sampled = equivalence_check.remaining_sampled_experiments(folder)
        experiments = [planned[s.id] for s in sampled if self._has_final_record(s.id)]
        self._prove_by_crew(experiments)
        return self._session.compare_sample(folder.records())

    def _begin_work(self) -> Session:
        """Return the session, which records software and machine before the first run of this opening."""
        session = self._begun_session()
        if self._engine != REFERENCE or (session.reuse and session.reuse.searches):
            equivalence_check.mark_check_as_needed(self.path)
        if not self._has_begun:
            session.begin_environment(f"{session.worker_prefix}*")
            self._has_begun = True
        return session

    def _prove_by_crew(self, experiments: Sequence[Experiment]) -> None:
        if not experiments:
            return
        self._progress.note_proof(len(experiments))
        self._hand_out(experiments, is_proof=True)
        for _ in experiments:
            self._receive()
        self._awaited.running.clear()
        self._progress.note_proof_ended()

    def _hand_out(self, experiments: Sequence[Experiment], *, is_proof: bool = False) -> None:
        if self._has_crew_old_limits:  # workers have the limits with which they began
            self._receive_records(self._awaited.running)
            self._crew.use_new_limits()
            self._has_crew_old_limits = False
        session = self._begin_work()
        batch = CrewBatch(
            runs=order_for_sharing(group_by_run(self._manifest, experiments)),
            golden_digests=golden_digests(session.folder),
            scenario_files=dict(self._batch_check.scenario_files),
            is_proof=is_proof,
        )
        self._crew.hand_out(batch)
        self._awaited.running |= {experiment.id for experiment in experiments}

    def _start_of_worker(self, number: int) -> WorkerStart:
        return self._begun_session().start_of_worker(f"w{number}")

    def _begun_session(self) -> Session:
        assert self._session is not None
        return self._session

    def _note_written(self, worker: str, written: Mapping[str, str]) -> None:
        self._begun_session().written.add_report(written, worker)

    def _has_final_record(self, experiment_id: str) -> bool:
        record = self._new_records.get(experiment_id) or self._stored_records.get(experiment_id)
        return record is not None and record.status is not Status.HARNESS_ERROR

    def _records_by_id(self, experiment_id: str) -> Record:
        return self._new_records.get(experiment_id) or self._stored_records[experiment_id]
