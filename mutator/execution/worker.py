"""The process that runs chunks: an xdist worker, or the command itself."""

import signal
import socket
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mutator._common import cache_layout_and_pruning
from mutator._common.confined_files import path_below
from mutator._common.files import raising_disk_full
from mutator.campaigns.chunks import PendingChunk
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import MODES_TO_PROVE, Engine, EngineArguments
from mutator.engines.in_target import process_guard
from mutator.engines.reference_engine import ReferenceEngine
from mutator.execution.experiment_runner import (
    ExperimentRunner,
    RecordedExperiment,
    record_without_outcome,
)
from mutator.execution.inactivity_check import InactivityCheck
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.execution.run_reuse import ReuseAssignment, RunReuse
from mutator.execution.written_files import FileDigests
from mutator.model import Experiment, Record, Status
from mutator.preflight import equivalence_check
from mutator.preflight.equivalence_check import SampledExperiment
from mutator.store import plan_file
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.run_folder import RunFolder
from mutator.store.run_writer import RunWriter
from mutator.store.timings import ending_text


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkerAssignment:
    """The role of a worker.

    `worker_name` makes its file names in the run folder unique. `parent_pid` is the process that the worker
    must not outlive (None: the worker is the command itself). `golden_digests` has the digest of each golden
    run, and `secret` authenticates files that workers share; neither is in a file. Without `reuse`, the store
    of finished runs is left out.
    """

    run_folder: Path
    worker_name: str
    engine: str
    golden_digests: Mapping[str, str]
    secret: bytes
    parent_pid: int | None = None
    reuse: ReuseAssignment | None = None


class Worker:
    """Runs chunks of a run folder and appends their results. Reads the plan chunk by chunk."""

    def __init__(self, inputs: RunInputs, assignment: WorkerAssignment) -> None:
        self.was_suspended = False  # a signal handler sets it
        self.folder = RunFolder.open(assignment.run_folder)
        check_sources(self.folder.path, self.folder.head.sources, inputs.digest_by_source())
        with raising_disk_full(self.folder.scratch_folder):
            self.folder.scratch_folder.mkdir(exist_ok=True)
        self._inputs, self._manifest, self._assignment = inputs, inputs.manifest, assignment
        self._scenario_files = dict(inputs.scenario_files)
        self._digest_by_golden_folder: dict[Path, str] = {}
        self._reuse = (
            RunReuse(assignment.reuse, self.folder, assignment.worker_name, self._golden_digest_of)
            if assignment.reuse
            else None
        )
        self.add_inputs(goldens=assignment.golden_digests)
        self._runner = self._make_runner(
            self._make_engine(assignment.engine),
            with_series=bool(self.folder.series_budget_mb),
            reuse=self._reuse,
        )
        self._current_seed: int | None = None  # the seed being run
        self._prover: ExperimentRunner | None = None
        self._needs_proof: bool | None = None  # None: not known yet
        self._planned_experiments: Mapping[str, Experiment] = {}
        self._faults = plan_file.load_faults(self.folder.path)
        self._writer = RunWriter(
            self.folder, assignment.worker_name
        )  # last: nothing is written if the rest fails

    def run(self, pending: PendingChunk) -> list[tuple[str, str]]:
        """Run the rest of a chunk; return (experiment id, detail) of each harness error."""
        experiments = plan_file.load_chunk(
            self.folder.path, self.folder.head.chunks[pending.chunk_index], self._faults
        )
        pending_experiments = [experiments[place] for place in pending.pending_positions]
        return [
            (record.experiment_id, record.detail)
            for record in self.run_experiments(pending_experiments)
            if record.status is Status.HARNESS_ERROR
        ]

    def run_experiments(self, experiments: Sequence[Experiment]) -> Iterator[Record]:
        """Run experiments of the plan, at least one; store what each gave, and yield its record."""
        self._prune_cached_images(experiments[0].seed)
        for ended in self._runner.run(experiments):
            finished = self._without_outcome_if_suspended(ended)
            self._store_finished(finished)
            if finished.mode in MODES_TO_PROVE:
                self._needs_proof = True
            yield finished.record

    def add_inputs(
        self, *, goldens: Mapping[str, str] | None = None, scenario_files: Mapping[str, Path] | None = None
    ) -> None:
        """Add digests of golden runs, by key, and files of scenarios, for a plan that has grown."""
        self._scenario_files |= scenario_files or {}
        self._digest_by_golden_folder |= {
            path_below(self.folder.path / "golden", key): golden_digest
            for key, golden_digest in (goldens or {}).items()
        }
        if goldens and self._reuse:
            self._reuse.note_new_goldens()

    def _golden_digest_of(self, experiment: Experiment) -> str:
        return self._digest_by_golden_folder[self.folder.golden_folder_of(experiment)]

    def _prune_cached_images(self, seed: int) -> None:
        """Delete images of earlier seeds, which would fill the disk."""
        if self.folder.has_seeded_goldens and seed != self._current_seed:
            cache_layout_and_pruning.prune_target_cache(self._manifest.cache_name)
        self._current_seed = seed

    def prove(self, sample: SampledExperiment) -> list[tuple[str, str]]:
        """Run an experiment of the proof's sample on the reference engine; return harness errors as `run`
        does.

        The run uses no data of other runs, because the proof must also detect errors in such data. If no
        experiment was forked, nothing is run.
        """
        if self._needs_proof is None:
            self._needs_proof = equivalence_check.reason_check_not_needed(self.folder) is None
        if not self._needs_proof:
            return []
        if not self._planned_experiments:
            self._planned_experiments = PlannedExperiments(self.folder.path)
        return [
            (record.experiment_id, record.detail)
            for record in self.prove_experiments([self._planned_experiments[sample.id]])
            if record.status is Status.HARNESS_ERROR
        ]

    def prove_experiments(self, experiments: Sequence[Experiment]) -> Iterator[Record]:
        """Run experiments on the reference engine for the proof, and yield their records."""
        if self._prover is None:
            self._prover = self._make_runner(self._make_independent_engine())
        for ended in self._prover.run(experiments):
            finished = self._without_outcome_if_suspended(ended)
            self._writer.append_proof(finished.record)
            yield finished.record

    @property
    def file_digests(self) -> FileDigests:
        """The digests of the files whose lines count."""
        return self._writer.sha256_by_segment

    def close(self) -> None:
        self._runner.close()
        self._writer.close()
        if self._reuse:
            self._reuse.close()

    def _make_runner(
        self, engine: Engine, *, with_series: bool = False, reuse: RunReuse | None = None
    ) -> ExperimentRunner:
        folder = self.folder
        goldens = LoadedGoldens(
            self._manifest,
            folder.golden_folder_of,
            several_seeds=folder.has_seeded_goldens,
            digests=self._digest_by_golden_folder,
        )
        inputs = self._inputs
        return ExperimentRunner(
            self._manifest,
            inputs.fault_models,
            engine,
            goldens,
            self._scenario_files.__getitem__,
            with_series=with_series,
            inactivity_check=InactivityCheck(self._engine_arguments()),
            find_finished_run=reuse.find if reuse else lambda experiment, mutant: None,
        )

    def _make_engine(self, name: str) -> Engine:
        return make_engine(name, self._engine_arguments())

    def _engine_arguments(self) -> EngineArguments:
        folder = self.folder
        return EngineArguments(
            manifest=self._manifest,
            models=self._inputs.fault_models,
            work_folder=folder.scratch_folder,
            limits=folder.limits,
            parent_pid=self._assignment.parent_pid,
            secret=self._assignment.secret,
        )

    def _make_independent_engine(self) -> Engine:
        folder = self.folder
        return ReferenceEngine(
            self._manifest,
            folder.scratch_folder,
            folder.limits,
            self._assignment.parent_pid,
            independent=True,
        )

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


def python_command_dying_with(parent_pid: int) -> list[str]:
    """Return the beginning of a Python command line whose process dies with its parent, even while starting.

    It imports nothing from its working folder.
    """
    # without site-packages, which the guard does not need and which take time to find
    return [sys.executable, "-I", "-S", process_guard.__file__, str(parent_pid), sys.executable, "-P"]


def bind_to_parent(parent_pid: int) -> None:
    """End this process when `parent_pid` ends, and ignore Ctrl-C, which the parent handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    process_guard.die_with_parent(parent_pid)
