"""A process that runs experiments: an xdist worker, a worker of a bench, or the command itself."""

import os
import socket
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mutator._common.files import raising_disk_full
from mutator._common.folder_locks import open_worker_lock
from mutator._common.pickled_values import PickledValue
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources
from mutator.campaigns.shared_runs import run_key
from mutator.engines.engine_jobs import MOST_WAITING_PROCESSES, EngineArguments, RunMode
from mutator.execution.code_recording import CodeRecording, RecordingAssignment
from mutator.execution.experiment_runner import (
    CopiedRun,
    RecordedExperiment,
    find_nothing,
)
from mutator.execution.golden_facts import GoldenFacts
from mutator.execution.golden_hazards import GoldenHazardRules
from mutator.execution.records_without_outcome import record_without_outcome
from mutator.execution.run_reuse import ReuseAssignment, RunReuse
from mutator.execution.suspended_workers import on_resume
from mutator.execution.unaffected_runs import UnaffectedRuns
from mutator.execution.worker_processes import bind_to_parent
from mutator.execution.worker_runners import WorkerRunners
from mutator.execution.written_files import FileDigests
from mutator.model import Experiment, Record, Status
from mutator.mutants.mutant_building import Mutant
from mutator.store.golden_files import GOLDEN_FOLDER, GoldenFolders
from mutator.store.run_folder import RunFolder
from mutator.store.run_writer import RunWriter
from mutator.store.timings import ending_text

_WAITING_PROCESSES_OF_BENCH = 32  # its experiments come in any order, those of a campaign by golden run


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerAssignment:
    """The role of a worker.

    `worker_name` makes its file names in the run folder unique. `parent_pid` is the process that the worker
    must not outlive (None: the worker is the command itself). `golden_digests` has the digest of each golden
    run, and `secret` authenticates files that workers share; neither is in a file. Without `reuse`, the store
    of finished runs is left out; without `recording`, nobody notes what runs execute.
    """

    run_folder: Path
    worker_name: str
    engine: str
    golden_digests: Mapping[str, str]
    secret: bytes
    parent_pid: int | None = None
    reuse: ReuseAssignment | None = None
    recording: RecordingAssignment | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerStart(PickledValue):
    """What a process needs to begin as a worker. `inputs` is packed by `RunInputs.to_bytes`."""

    inputs: bytes
    assignment: WorkerAssignment


class Worker:
    """Runs experiments of a run folder and appends their results."""

    def __init__(self, inputs: RunInputs, assignment: WorkerAssignment) -> None:
        self.was_suspended = False  # a signal handler sets it
        self.folder = RunFolder.open(assignment.run_folder)
        check_sources(self.folder.path, self.folder.head.sources, inputs.digest_by_source())
        with raising_disk_full(self.folder.scratch_folder):
            self.folder.scratch_folder.mkdir(exist_ok=True)
        self._manifest, self._assignment = inputs.manifest, assignment
        self._scenario_files = dict(inputs.scenario_files)
        self._planned_scenarios = inputs.planned_scenarios
        self._golden_folders = GoldenFolders(self.folder.scratch_folder)
        self._digest_by_golden: dict[str, str] = {}  # by key
        self._reuse = (
            RunReuse(assignment.reuse, self.folder, assignment.worker_name, self._golden_digest_of)
            if assignment.reuse
            else None
        )
        recording = assignment.recording
        self._recording = CodeRecording(recording, self.folder, inputs.manifest) if recording else None
        self._unaffected = (
            UnaffectedRuns(recording.earlier_run, self._recording, inputs.manifest, self._golden_digest_of)
            if recording and self._recording and recording.earlier_run
            else None
        )
        self.add_inputs(goldens=assignment.golden_digests)
        most_waiting = _WAITING_PROCESSES_OF_BENCH if self.folder.is_bench else MOST_WAITING_PROCESSES
        self._runners = WorkerRunners(
            EngineArguments(
                manifest=inputs.manifest,
                models=inputs.fault_models,
                work_folder=self.folder.scratch_folder,
                limits=self.folder.limits,
                parent_pid=assignment.parent_pid,
                secret=assignment.secret,
                most_waiting_processes=most_waiting,
            ),
            assignment.engine,
            golden_folder_of=lambda experiment: self._golden_folders.output_folder(
                self.folder.path / GOLDEN_FOLDER, self.folder.golden_run_of(experiment).key
            ),
            digest_by_golden=self._digest_by_golden,
            has_seeded_goldens=self.folder.has_seeded_goldens,
            scenario_file=self._scenario_file,
            with_series=bool(self.folder.series_budget_mb),
            golden_hazard_rules=GoldenHazardRules(
                include=self.folder.head.include, scale=self.folder.severity_scale
            ),
            find_copied_run=self._find_copied_run,
            find_proof=self._unaffected.find_for_proof if self._unaffected else find_nothing,
        )
        self._last_finished: RecordedExperiment | None = None
        self._writer = RunWriter(
            self.folder, assignment.worker_name
        )  # last: nothing is written if the rest fails

    def run_experiments(self, experiments: Sequence[Experiment]) -> Iterator[Record]:
        """Run experiments of the plan, at least one; store what each gave, and yield its record."""
        return (finished.record for finished in self.run_and_store(experiments))

    def run_and_store(self, experiments: Sequence[Experiment]) -> Iterator[RecordedExperiment]:
        """Like `run_experiments`, but yield all that each gave.

        An experiment that shares its run with the one before is not run, even if they come one by one.
        """
        experiments = list(experiments)
        while experiments and (shared := self._shared_result(experiments[0])) is not None:
            del experiments[0]
            self._store_finished(shared)
            yield shared
        for ended in self._runners.run(experiments) if experiments else ():
            finished = self._without_outcome_if_suspended(ended)
            self._store_finished(finished)
            self._last_finished = finished
            yield finished

    def _shared_result(self, experiment: Experiment) -> RecordedExperiment | None:
        """Return what an experiment gives that shares its run with the last one."""
        last = self._last_finished
        if last is None or last.record.status in (Status.HARNESS_ERROR, Status.LEFT_OUT):
            return None
        if run_key(self._manifest, last.experiment) != run_key(self._manifest, experiment):
            return None
        record = replace(last.record, experiment_id=experiment.id)
        return replace(last, experiment=experiment, record=record, cpu_s=0.0, wall_s=0.0)

    def add_inputs(
        self, *, goldens: Mapping[str, str] | None = None, scenario_files: Mapping[str, Path] | None = None
    ) -> None:
        """Add digests of golden runs, by key, and files of scenarios, for a plan that has grown."""
        self._scenario_files |= scenario_files or {}
        self._digest_by_golden |= goldens or {}
        if goldens and self._reuse:
            self._reuse.note_new_goldens()
        if goldens and self._recording:
            self._recording.note_new_goldens()

    def add_goldens(self, facts: GoldenFacts) -> None:
        """Add golden runs whose checks have passed since this worker began, before any are in checks.json."""
        self.add_inputs(goldens=facts.digest_by_key)
        for part in (self._reuse, self._recording):
            if part:
                part.packages.add_goldens(facts)

    def _scenario_file(self, name: str) -> Path:
        if name in self._scenario_files or self._planned_scenarios is None:
            return self._scenario_files[name]
        return self._planned_scenarios.file(name)

    def _find_copied_run(self, experiment: Experiment, mutant: Mutant) -> CopiedRun | None:
        finders = (self._unaffected, self._reuse)
        runs = (finder.find(experiment, mutant) for finder in finders if finder)
        return next((run for run in runs if run), None)

    def _golden_digest_of(self, experiment: Experiment) -> str:
        return self._digest_by_golden[self.folder.golden_run_of(experiment).key]

    def prove_experiments(self, experiments: Sequence[Experiment]) -> Iterator[Record]:
        """Run experiments on the reference engine for the proof, and yield their records."""
        for ended in self._runners.prove(experiments):
            finished = self._without_outcome_if_suspended(ended)
            self._writer.append_proof(finished.record)
            yield finished.record

    @property
    def file_digests(self) -> FileDigests:
        """The digests of the files whose lines count."""
        return self._writer.sha256_by_segment

    def close(self) -> None:
        self._runners.close()
        self._writer.close()
        if self._reuse:
            self._reuse.close()

    def _without_outcome_if_suspended(self, finished: RecordedExperiment) -> RecordedExperiment:
        """Return the experiment; one that ran when this worker was stopped has no outcome."""
        if not self.was_suspended:
            return finished
        self.was_suspended = False
        record, why = finished.record, "its worker was stopped while it ran"
        bare = record_without_outcome(record.experiment_id, Status.HARNESS_ERROR, why)
        return replace(finished, record=replace(bare, tree=record.tree, patch=record.patch), series=None)

    def _store_finished(self, finished: RecordedExperiment) -> None:
        patch = None if finished.mutant is None else finished.mutant.patch_bytes
        timing = timing_of(finished, self._assignment.worker_name)
        if self._recording and (code := self._recording.code_of(finished)):
            timing["executed"] = self._writer.append_executed_code(code)
        is_left_out = finished.record.status is Status.LEFT_OUT
        if self._unaffected and not is_left_out and finished.mode is not RunMode.UNAFFECTED:
            timing["affected"] = self._unaffected.reason(finished.experiment)
        self._writer.append(finished.record, timing, patch, finished.series)
        if self._reuse:
            self._reuse.note(finished)


def timing_of(finished: RecordedExperiment, worker: str) -> dict[str, Any]:
    return {
        "experiment_id": finished.experiment.id,
        "cpu_s": finished.cpu_s,
        "wall_s": finished.wall_s,
        "host": socket.gethostname(),
        "worker": worker,
        "engine": finished.mode,
        "why": finished.fallback_reason,
        "ended": ending_text(datetime.now(UTC)),
    }


class WorkerOfProcess:
    """The worker of a process that a command has started. It is made when its first work comes.

    The process is registered in the run folder, and dies with the command.
    """

    def __init__(self, start: WorkerStart) -> None:
        assert start.assignment.parent_pid is not None
        bind_to_parent(start.assignment.parent_pid)
        self._start = start
        self._registration = open_worker_lock(start.assignment.run_folder)
        self._worker: Worker | None = None
        on_resume(self._note_suspension)

    def ensure_worker(self) -> Worker:
        if self._worker is None:
            self._worker = Worker(RunInputs.from_bytes(self._start.inputs), self._start.assignment)
        return self._worker

    def close(self) -> dict[str, str]:
        """Close the worker's files; return their digests."""
        worker, self._worker = self._worker, None
        try:
            if worker is None:
                return {}
            worker.close()
            return dict(worker.file_digests)
        finally:
            os.close(self._registration)

    def _note_suspension(self) -> None:
        if self._worker is not None:
            self._worker.was_suspended = True
