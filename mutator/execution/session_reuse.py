"""The store of finished runs as one session uses it: what its workers search, and what it adds after the
proof.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property

from mutator.campaigns import run_environment, shared_runs
from mutator.engines.engine_jobs import RunMode
from mutator.engines.engine_kinds import REFERENCE
from mutator.execution.earlier_run import EarlierRunUse
from mutator.execution.finished_run_keys import harness_digest, run_key, surroundings_digest
from mutator.execution.run_reuse import ReuseAssignment, is_storable
from mutator.model import Experiment, Record, Status
from mutator.store.finished_run_store import FinishedRun, FinishedRuns, UnprovedRuns, store_finished_runs
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.preflight_results import golden_digests
from mutator.store.records import PROOF_FOLDER
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


class SessionReuse:
    """The store as a session uses it that runs on `engine`. `requested_engine` is what the user asked for."""

    def __init__(
        self,
        workspace: Workspace,
        manifest: TargetManifest,
        earlier: EarlierRunUse,
        *,
        requested_engine: str | None,
        engine: str,
    ) -> None:
        self._workspace, self._manifest = workspace, manifest
        self._requested_engine, self._engine = requested_engine, engine
        self._earlier = earlier

    @cached_property
    def searches(self) -> bool:
        """Whether workers take runs from the store. No, if the user asked for the reference engine."""
        if self._requested_engine == REFERENCE:
            return False
        # what is found needs a proof, which a target that cannot be forked has not otherwise
        return self._engine != REFERENCE or FinishedRuns().has_any()

    @cached_property
    def assignment(self) -> ReuseAssignment:
        return ReuseAssignment(
            surroundings=surroundings_digest(self._workspace, self._manifest),
            harness=harness_digest(),
            searches=self.searches,
            version_by_package=run_environment.versions_of_fixed_packages(),
            unproved_records=self._earlier.unproved_records,
        )

    def store_proved_runs(self, folder: RunFolder, records: Mapping[str, Record]) -> None:
        """Store the runs that workers of this folder noted, in this session or an earlier one."""
        unproved = _unproved_runs(folder)
        store_finished_runs(_runs_as_recorded(folder, records, unproved))
        unproved.delete()

    def forget_unproved_runs(self, folder: RunFolder, records: Mapping[str, Record]) -> None:
        """After a failed proof, delete what was to be stored, and what the wrong records were copied from."""
        _unproved_runs(folder).delete()
        planned, golden_digest_by_key, timings = (
            PlannedExperiments(folder.path),
            golden_digests(folder),
            folder.timings(),
        )
        for name, proof_record in folder.records(PROOF_FOLDER).items():
            record = records.get(name)
            is_wrong = record not in (None, proof_record) and proof_record.status is not Status.HARNESS_ERROR
            if record and is_wrong and timings.get(name, {}).get("engine") == RunMode.REUSED.value:
                for experiment in self._experiments_sharing_run_with(planned[name], planned.values()):
                    golden_digest = _golden_digest_of(folder, experiment, golden_digest_by_key)
                    surroundings = self.assignment.surroundings
                    FinishedRuns().forget(run_key(surroundings, experiment, record.tree, golden_digest))

    def _experiments_sharing_run_with(
        self, experiment: Experiment, planned: Iterable[Experiment]
    ) -> list[Experiment]:
        """Return the experiments of the same run: any of them can have searched the store for all."""
        key = shared_runs.run_key(self._manifest, experiment)
        return [other for other in planned if shared_runs.run_key(self._manifest, other) == key]


def count_reused(folder: RunFolder, worker_prefix: str) -> int:
    """Return how many experiments workers whose names begin so took from the store."""
    return sum(
        line["engine"] == RunMode.REUSED.value and line["worker"].startswith(worker_prefix)
        for line in folder.timings().values()
    )


def _unproved_runs(folder: RunFolder) -> UnprovedRuns:
    return UnprovedRuns(folder.path, folder.head.plan_of_lines)


def _golden_digest_of(folder: RunFolder, experiment: Experiment, digest_by_key: Mapping[str, str]) -> str:
    return digest_by_key.get(folder.golden_run_of(experiment).key, "")


def _runs_as_recorded(
    folder: RunFolder, records: Mapping[str, Record], unproved: UnprovedRuns
) -> Iterator[tuple[str, FinishedRun]]:
    """Yield the runs that the store lacks. A run counts only if the run folder has its record, and if its key
    follows from the plan: a mutant can write to the cache.
    """
    planned: PlannedExperiments | None = None
    golden_digest_by_key: Mapping[str, str] = {}
    stored = FinishedRuns()
    for key, run in unproved:
        if planned is None:  # a session without new runs reads no plan
            planned, golden_digest_by_key = PlannedExperiments(folder.path), golden_digests(folder)
        name, record = run.record.experiment_id, run.record
        if name not in planned or records.get(name) != record or not is_storable(record):
            continue
        golden_digest = _golden_digest_of(folder, planned[name], golden_digest_by_key)
        is_own_key = key == run_key(run.surroundings, planned[name], record.tree, golden_digest)
        if is_own_key and not any(_is_as_good(other, run) for other in stored.find_all(key)):
            yield key, run


def _is_as_good(stored: FinishedRun, run: FinishedRun) -> bool:
    has_series = stored.faulty_series is not None or run.faulty_series is None
    return has_series and stored.packages == run.packages
