"""The reuse of finished runs by a worker: it searches the store before a run, and notes what a run gave."""

import builtins
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from mutator._common.hashing import digest
from mutator.engines.engine_jobs import RunMode
from mutator.engines.executed_functions import executed_functions_from_json
from mutator.engines.process_endings import EXITED_DETAIL, KILLED_DETAIL
from mutator.execution.experiment_runner import CopiedRun, RecordedExperiment
from mutator.execution.finished_run_keys import harness_digest, run_key
from mutator.execution.loaded_packages import LoadedPackages
from mutator.model import Experiment, Record, RunError, Status
from mutator.mutants.mutant_building import Mutant
from mutator.store.finished_run_store import FinishedRun, FinishedRuns, UnprovedRuns
from mutator.store.records import record_as_json
from mutator.store.run_folder import RunFolder

# not in the middle of a word, as in `km/h`; often the path of the scenario's file
_ABSOLUTE_PATH_PATTERN = re.compile(r"(?<![\w/.])/\w")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReuseAssignment:
    """How a worker uses the store.

    * `surroundings`: the digest of what all runs of its session have in common
    * `harness`: the digest of the harness's code in it. A worker with other code leaves the store alone.
    * `searches`: whether it takes runs from the store; if not, it only notes runs
    * `version_by_package`: all installed packages whose version tells what their code is
    * `unproved_records`: digests, by experiment, of records whose runs an earlier session in this folder
      noted but could not prove. The proof of this session covers them.
    """

    surroundings: str
    harness: str
    searches: bool
    version_by_package: Mapping[str, str | None]
    unproved_records: Mapping[str, str] = field(default_factory=dict)


class RunReuse:
    """The store as a worker uses it. `golden_digest_of` returns the digest of an experiment's golden run."""

    def __init__(
        self,
        assignment: ReuseAssignment,
        folder: RunFolder,
        worker_name: str,
        golden_digest_of: Callable[[Experiment], str],
    ) -> None:
        self._surroundings = assignment.surroundings
        # a worker of a bench can begin long after its session, when somebody has edited the harness
        self._is_in_use = harness_digest() == assignment.harness
        self._searches = assignment.searches and self._is_in_use
        self.packages = LoadedPackages(folder, assignment.version_by_package)
        self._with_series = bool(folder.series_budget_mb)
        self._golden_digest_of = golden_digest_of
        self._stored = FinishedRuns()
        self._unproved = UnprovedRuns(folder.path, folder.head.plan_of_lines, worker_name)
        self._unproved_records = assignment.unproved_records

    def find(self, experiment: Experiment, mutant: Mutant) -> CopiedRun | None:
        """Return the stored run of an experiment; None if it must run."""
        if not self._searches:
            return None
        patch_digest = digest(mutant.patch_bytes)

        def is_usable(run: FinishedRun) -> bool:
            return (
                (run.record.tree, run.record.patch) == (mutant.tree_digest, patch_digest)
                and run.surroundings == self._surroundings
                and is_storable(run.record)
                and (run.faulty_series is not None or not self._with_series or run.record.status != Status.OK)
                and self.packages.have_versions(run.packages)
            )

        key = self._key_of(experiment, mutant)
        run = self._stored.find(key, is_usable) or self._earlier_unproved.get(key)
        if run is None or not is_usable(run):
            return None
        return CopiedRun(
            record=run.record,
            faulty_series=run.faulty_series,
            mode=RunMode.REUSED,
            executed_functions=executed_functions_from_json(run.executed),
            packages=run.packages,
        )

    @cached_property
    def _earlier_unproved(self) -> Mapping[str, FinishedRun]:
        """Runs that an earlier session noted, by key. A mutant can write to the cache, so each must have the
        record that the session received.
        """
        if not self._unproved_records:
            return {}
        return {
            key: run
            for key, run in self._unproved
            if self._unproved_records.get(run.record.experiment_id) == digest(record_as_json(run.record))
        }

    def note(self, finished: RecordedExperiment) -> None:
        """Note what a run gave, for the store."""
        mutant, record = finished.mutant, finished.record
        if not self._is_in_use or mutant is None or finished.is_copied or not is_storable(record):
            return
        packages = self.packages.versions(finished.third_party_modules, mutant)
        if packages is None:
            return  # it loaded code that can change
        executed = finished.executed_functions
        run = FinishedRun(
            record=record,
            packages=packages,
            surroundings=self._surroundings,
            faulty_series=finished.series.faulty_bytes if finished.series else None,
            executed=executed.as_json() if executed else None,
        )
        self._unproved.append(self._key_of(finished.experiment, mutant), run)

    def note_new_goldens(self) -> None:
        """Note that the run folder has more golden runs."""
        self.packages.note_new_goldens()

    def close(self) -> None:
        self._unproved.close()

    def _key_of(self, experiment: Experiment, mutant: Mutant) -> str:
        golden_digest = self._golden_digest_of(experiment)
        return run_key(self._surroundings, experiment, mutant.tree_digest, golden_digest)


def is_storable(record: Record) -> bool:
    """Whether a record is the same with other limits, with or without the sandbox, and in another folder: it
    was not cut off, the harness did not fail, and no text in it names an absolute path.
    """
    if record.status in (Status.TIMEOUT, Status.HARNESS_ERROR) or not record.tree:
        return False
    texts = (record.detail, record.error.message if record.error else "")
    if any(map(_ABSOLUTE_PATH_PATTERN.search, texts)):
        return False
    # native code that gets no memory can end the process
    return not _is_by_limits(record.error) and not record.detail.startswith((EXITED_DETAIL, KILLED_DETAIL))


def _is_by_limits(error: RunError | None) -> bool:
    """Whether a run with another limit of memory or disk space, or with another sandbox, could go on."""
    if error is None:
        return False
    kind = getattr(builtins, error.kind, None)
    is_of_system = isinstance(kind, type) and issubclass(kind, OSError)
    return is_of_system or error.kind.endswith(("MemoryError", "OSError"))
