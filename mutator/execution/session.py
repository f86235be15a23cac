"""A session: one command holds the lock of a run folder and takes the run from plan to results.

`distributor_choice` decides which processes do the work.
"""

import os
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from secrets import token_bytes

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import write_below
from mutator._common.folder_locks import wait_for_workers
from mutator.audit.run_digests_and_seal import seals_of
from mutator.campaigns.chunks import PendingChunk, pending_chunks_of
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import (
    accepted_version_differences,
    add_loaded_packages,
    append_worker_machine,
    begin_session_environment,
)
from mutator.engines.engine_choice import choose_engine, reason_not_forkable
from mutator.engines.engine_kinds import REFERENCE
from mutator.engines.job_folder import ensure_work_folder
from mutator.errors import CheckFailed, DiskFull, MutatorError
from mutator.execution.code_recording import RecordingAssignment, build_recording_assignment
from mutator.execution.earlier_run import EarlierRunUse
from mutator.execution.finished_outcome_cache import (
    FinishedRunOutcome,
    find_finished_run,
    remember_finished_run,
)
from mutator.execution.session_checks import SessionChecks
from mutator.execution.session_proof import prove_rest_of_sample, remaining_proof
from mutator.execution.session_reuse import SessionReuse, count_reused
from mutator.execution.session_summary import Summary, has_reached_nothing
from mutator.execution.worker import Worker, WorkerAssignment, WorkerStart
from mutator.execution.worker_names import new_worker_prefix, unused_worker_name
from mutator.execution.written_files import WrittenFiles
from mutator.model import Record
from mutator.preflight import equivalence_check
from mutator.preflight.preflight_checks import checks_and_goldens_exist
from mutator.results import table_building
from mutator.results.note_on_golden_hazards import left_out_note_of_records
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_rank_by_ok_experiment
from mutator.store import file_digests
from mutator.store.file_digests import FileDigest
from mutator.store.preflight_results import are_verdicts_provisional, golden_digests
from mutator.store.records import endings_of
from mutator.store.run_folder import RunFolder
from mutator.store.run_head import HEAD
from mutator.store.run_progress import Progress, ProgressCallback, progress_label
from mutator.store.series_packing import list_unpacked_worker_files, pack_series
from mutator.store.session_environments import WorkerMachine
from mutator.targets.required_packages import check_requirements
from mutator.workspace import Workspace

_SECRET_BYTES = 16  # 128 bits, which no mutant can guess


class Session:
    """One command's work on a run folder, which it has locked."""

    def __init__(
        self,
        workspace: Workspace,
        folder: RunFolder,
        *,
        workers: int = 0,
        engine: str | None = None,
        accept_versions: bool = False,
        reuse: bool = True,
        earlier: EarlierRunUse | None = None,
        notify: ProgressCallback = lambda progress: None,
    ) -> None:
        self.workspace = workspace
        self.folder = folder
        self.workers = workers
        self.accept_versions = accept_versions
        self.notify = notify  # tells whoever started or watches the session how far it is
        self.pending: tuple[PendingChunk, ...] = ()
        self.proof: tuple[equivalence_check.SampledExperiment, ...] = ()
        self.manifest = workspace.manifest_of(folder.head)
        self._earlier = earlier or EarlierRunUse()
        self._earlier.check_target(folder)
        self.engine = choose_engine(engine, self.manifest)
        self._not_forked = "" if engine else reason_not_forkable(self.manifest)
        self.reuse = (
            SessionReuse(workspace, self.manifest, self._earlier, requested_engine=engine, engine=self.engine)
            if reuse
            else None
        )
        self._unselected_count = 0  # experiments without a record that are left for another session
        self.worker_prefix = new_worker_prefix(folder.path)  # of the names of this session's workers
        self.problem = ""
        self.interrupted = False
        self.secret = token_bytes(_SECRET_BYTES)
        self.golden_digests: Mapping[str, str] = {}
        self.written = WrittenFiles()
        self._ledger_at_start: file_digests.DigestLedger | None = None  # as it was when the work began
        self._head_at_start = b""
        self.workers_note = ""  # the present workers, if known
        self.checks = SessionChecks(
            workspace,
            workers=workers,
            secret=self.secret,
            with_forks=self.engine != REFERENCE,
            notify=notify,
        )
        self._start_s = time.monotonic()
        self._finished_count_before = 0
        self._records: Mapping[str, Record] | None = None
        self._earlier_outcome: FinishedRunOutcome | None = None

    def prepare(self, packages: Iterable[str] = (), *, checks_beside: bool = False) -> None:
        """Find the work to do. If there is any, run the checks and begin a stretch, which records the
        versions of `packages` and of those that affect every run.

        With `checks_beside`, whoever deals experiments to workers also deals `checks.beside`. Unless
        `accept_versions`, raises MutatorError if versions of Python or packages have changed.
        """
        self._earlier_outcome = find_finished_run(self.folder)
        if self._earlier_outcome and checks_and_goldens_exist(self.folder):
            self._finished_count_before = self.folder.planned_experiment_count
            return
        self._earlier_outcome = None
        records = self.folder.records()
        self.note_stored(records)
        selected_ids = self._earlier.selected_ids(self.folder)
        pending_chunks = pending_chunks_of(self.folder, records, selected_ids)
        copies = self._earlier.since or (self.reuse and self.reuse.searches)
        if pending_chunks and (self.engine != REFERENCE or copies):
            equivalence_check.mark_check_as_needed(self.folder.path)
        self.proof = remaining_proof(self.folder, selected_ids, records)
        if selected_ids is not None:
            pending = sum(len(chunk.pending_positions) for chunk in pending_chunks)
            planned = self.folder.planned_experiment_count
            self._unselected_count = planned - self._finished_count_before - pending
        has_checks = checks_and_goldens_exist(self.folder) and not are_verdicts_provisional(self.folder)
        if pending_chunks or self.proof or not has_checks:
            check_requirements(self.manifest)
            accepted_version_differences(self.folder, accept=self.accept_versions)
            self.checks.begin(self.folder, beside_experiments=checks_beside and bool(pending_chunks))
            self.begin_environment(f"{self.worker_prefix}*", packages)
            self.golden_digests = {} if self.checks.beside else golden_digests(self.folder)
            if self.folder.left_out_goldens:  # which the sample does without
                self.proof = remaining_proof(self.folder, selected_ids, records)
        self.pending = pending_chunks
        self._records = None if pending_chunks else records

    def note_stored(self, records: Mapping[str, Record]) -> None:
        """Note the records of earlier sessions."""
        self._finished_count_before = sum(ending.is_final for ending in endings_of(records))

    def find_work(self) -> None:
        """Find what remains to do in a run whose checks its bench has run."""
        records = self.folder.records()
        self.note_stored(records)
        self.pending = pending_chunks_of(self.folder, records)
        self.proof = equivalence_check.remaining_sampled_experiments(self.folder)
        self.golden_digests = golden_digests(self.folder)

    def note_machine(self, machine: WorkerMachine) -> None:
        self.note_own_files(append_worker_machine(self.folder, machine))

    def note_growth(self, folder: RunFolder) -> None:
        """Note that the plan of a bench has grown, and which packages its golden runs load."""
        self.note_own_files(add_loaded_packages(folder))

    def note_packages(self, packages: Iterable[str]) -> None:
        """Note packages that golden runs have loaded whose checks have passed."""
        self.check_own_files()
        self.note_own_files(add_loaded_packages(self.folder, packages))

    def begin_environment(self, records_glob: str, packages: Iterable[str] = ()) -> None:
        """Record the software and machine of this session, before its first run."""
        folder = begin_session_environment(
            self.folder,
            self.workspace,
            records_glob=records_glob,
            packages=packages,
            accept_versions=self.accept_versions,
        )
        self.note_own_files(folder)

    def note_own_files(self, folder: RunFolder) -> None:
        """Note run.json and the digests of the run folder as this command has just written them."""
        self.folder = folder
        self._head_at_start = read_bounded(folder.path / HEAD)
        self._ledger_at_start = file_digests.load_ledger(folder.path)

    def check_own_files(self) -> None:
        """Restore run.json and the digests of the run folder, and raise MutatorError, if a mutant has changed
        them.
        """
        ledger, run = self._ledger_at_start, self.folder.path
        if ledger is None:
            return
        changed_name = ""
        if not file_digests.is_ledger_unchanged(run, ledger):
            changed_name = file_digests.DIGESTS_FILE
            file_digests.save_ledger(run, ledger)
        if not FileDigest.of_bytes(self._head_at_start).has_same_bytes(FileDigest.of_file_below(run, HEAD)):
            changed_name = HEAD
            write_below(run, HEAD, self._head_at_start)
        if changed_name:
            raise MutatorError(
                "was changed by a mutant, or by another program",
                where=run / changed_name,
                remedy="it is restored: ask again",
            )

    def unused_worker_name(self, name: str) -> str:
        """Return a name like `0001-cluster`, or `0001-cluster2`, that no worker of this session has had."""
        return unused_worker_name(self.folder.path, f"{self.worker_prefix}{name}")

    @property
    def inputs(self) -> RunInputs:
        return RunInputs.of_run(self.workspace, self.folder)

    def worker_assignment(self, name: str, *, parent_pid: int | None = None) -> WorkerAssignment:
        """Return the role of this session's worker `name`; `parent_pid` is None for this process."""
        return WorkerAssignment(
            run_folder=self.folder.path,
            worker_name=f"{self.worker_prefix}{name}",
            engine=self.engine,
            golden_digests=dict(self.golden_digests),
            secret=self.secret,
            parent_pid=parent_pid,
            reuse=self.reuse.assignment if self.reuse else None,
            recording=self.recording,
        )

    @cached_property
    def recording(self) -> RecordingAssignment:
        """How workers note what runs execute, and what they leave out."""
        return build_recording_assignment(self.workspace, self.manifest, self._earlier.since)

    def start_of_worker(self, name: str) -> WorkerStart:
        """Return what another process needs to begin as a worker, whose files are believed from now on."""
        assignment = self.worker_assignment(name, parent_pid=os.getpid())
        self.written.note_worker_began(assignment.worker_name)
        return WorkerStart(inputs=self.inputs.to_bytes(), assignment=assignment)

    def finish(self, *, tables_of_part: bool = True) -> Summary:
        """End the session; return what it reports. Without `tables_of_part`, a part has no tables."""
        self.notify(Progress(stage="tables"))
        if self._earlier_outcome:
            return self._finish_finished_run(self._earlier_outcome)
        ensure_work_folder(self.folder.scratch_folder)  # readers refuse what a mutant can put in its place
        self._undo_writes_of_mutants()
        was_cut_off = self.interrupted or bool(self.problem)
        with self._noting_full_disk():
            if self.checks.finish(self.folder, was_cut_off=was_cut_off):
                self.note_own_files(add_loaded_packages(self.folder))
        is_provisional = self.checks.were_abandoned
        records = self.folder.records() if self._records is None else self._records
        ends = Counter((ending.status, ending.outcome) for ending in endings_of(records))
        failed = (ending.experiment_id for ending in endings_of(records) if not ending.is_final)
        harness_errors = {name: records[name].detail for name in failed}
        finished_count = len(records) - len(harness_errors)
        results_path = None
        with self._noting_full_disk():
            if not (was_cut_off or is_provisional):
                proved = prove_rest_of_sample(self.folder, records, self._make_proving_worker)
                self.written.add_report(proved)
            self._close_segments()
            is_whole = finished_count == self.folder.planned_experiment_count
            if (tables_of_part or is_whole) and not is_provisional:
                results_path = table_building.ensure_tables(self.folder.path)
                self._pack_series()
        proven = self.compare_sample(records)
        not_forked = "" if proven else self._not_forked
        if (
            proven
            and is_whole
            and (why := equivalence_check.reason_check_not_needed(self.folder)) is not None
        ):
            proven, not_forked = None, self._not_forked or why
            with self._noting_full_disk():
                equivalence_check.remove_proof(self.folder)
        if is_whole and not is_provisional and (proven is None or proven.is_complete):
            with self._noting_full_disk():
                self._close_segments(finished=True)
        has_proof = proven.is_complete if proven else bool(not_forked) or self.engine == REFERENCE
        if self.reuse and has_proof and not is_provisional:
            self.reuse.store_proved_runs(self.folder, records)
        outcomes = Counter[str]()
        for (status, outcome), count in ends.items():
            outcomes[progress_label(status, outcome)] += count
        seals = seals_of(self.folder)
        if seals.seal:
            remember_finished_run(
                self.folder, FinishedRunOutcome(outcomes=outcomes, proof=proven, seals=seals)
            )
        left_out, since_note = self._earlier.count_left_out(self.folder, self.worker_prefix)
        return Summary(
            planned=self.folder.planned_experiment_count,
            done=finished_count,
            ran=finished_count - self._finished_count_before,
            outcomes=outcomes,
            harness_errors=(*sorted(harness_errors.items()), *(proven.errors if proven else ())),
            problem=self.problem,
            interrupted=self.interrupted,
            results=results_path,
            proof=proven,
            seals=seals,
            not_forked=not_forked,
            elapsed_s=time.monotonic() - self._start_s,
            has_reached_nothing=has_reached_nothing(self.folder, outcomes, self._unselected_count),
            reused=count_reused(self.folder, self.worker_prefix),
            unselected=self._unselected_count,
            is_provisional=is_provisional,
            left_out=left_out,
            since_note=since_note,
            golden_hazards_note=left_out_note_of_records(self.folder, records, outcomes),
        )

    def _make_proving_worker(self) -> Worker:
        self.golden_digests = golden_digests(self.folder)  # those of late checks, too
        return Worker(self.inputs, self.worker_assignment("proof"))

    def compare_sample(self, records: Mapping[str, Record]) -> equivalence_check.EquivalenceResult | None:
        """Return the state of the equivalence check. What failed it is not stored for other runs."""
        try:
            return equivalence_check.compare_sample(self.folder, records)
        except CheckFailed:
            if self.reuse:
                self.reuse.forget_unproved_runs(self.folder, records)
            raise

    def _undo_writes_of_mutants(self) -> None:
        """Restore the digests of the run folder, and set aside lines that no worker wrote."""
        run = self.folder.path
        if self._ledger_at_start is None or wait_for_workers(run):
            return
        with self._noting_full_disk():
            changed = []
            if not file_digests.is_ledger_unchanged(run, self._ledger_at_start):
                file_digests.save_ledger(run, self._ledger_at_start)
                changed.append(file_digests.DIGESTS_FILE)
            changed += self.written.set_unreported_aside(run)
            if changed and not self.problem:
                self.problem = (
                    f"{run}: a mutant, or another program, changed {', '.join(changed)}; run the same "
                    "command again to repeat what is missing"
                )

    def _finish_finished_run(self, outcome: FinishedRunOutcome) -> Summary:
        results_path = None
        with self._noting_full_disk():
            results_path = table_building.ensure_tables(self.folder.path)
            self._pack_series()
        return Summary(
            planned=self.folder.planned_experiment_count,
            done=self.folder.planned_experiment_count,
            ran=0,
            outcomes=outcome.outcomes,
            harness_errors=(),
            problem=self.problem,
            interrupted=self.interrupted,
            results=results_path,
            proof=outcome.proof,
            seals=outcome.seals,
            not_forked="" if outcome.proof else self._not_forked,
            elapsed_s=time.monotonic() - self._start_s,
            has_reached_nothing=has_reached_nothing(self.folder, outcome.outcomes, self._unselected_count),
            golden_hazards_note=left_out_note_of_records(
                self.folder, self.folder.records(), outcome.outcomes
            ),
        )

    @contextmanager
    def _noting_full_disk(self) -> Iterator[None]:
        """Note a full disk as the session's problem. The records are complete; the rest can be made later."""
        try:
            yield
        except DiskFull as err:
            self.problem = self.problem or str(err)

    def _close_segments(self, *, finished: bool | None = None) -> None:
        if not wait_for_workers(self.folder.path):
            file_digests.add_segments_to_ledger(self.folder.path, finished=finished)

    def _pack_series(self) -> None:
        """Pack the workers' series. While a worker is still running, leave this to the next session."""
        folder = self.folder
        if list_unpacked_worker_files(folder.path) and not wait_for_workers(folder.path):
            ranks = worst_first_rank_by_ok_experiment(Results(folder.path).frame())
            pack_series(folder.path, folder.head.plan_of_lines, ranks, folder.series_budget_mb)
