"""The reuse of finished runs by a worker: it searches the store before a run, and notes what a run gave."""

import builtins
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

from mutator._common.hashing import digest
from mutator.campaigns import run_environment
from mutator.engines.process_endings import EXITED_DETAIL, KILLED_DETAIL
from mutator.execution.experiment_runner import RecordedExperiment
from mutator.execution.finished_run_keys import harness_digest, run_key
from mutator.model import Experiment, Record, RunError, Status
from mutator.mutants.mutant_building import Mutant
from mutator.store.finished_run_store import FinishedRun, FinishedRuns, UnprovedRuns
from mutator.store.preflight_results import (
    packages_loaded_by_golden_runs,
    unpackaged_modules_of_golden_runs,
)
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
    """

    surroundings: str
    harness: str
    searches: bool
    version_by_package: Mapping[str, str | None]


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
        self._version_by_package = assignment.version_by_package
        self._with_series = bool(folder.series_budget_mb)
        self._golden_digest_of = golden_digest_of
        self._run_path = folder.path
        self._golden_packages: tuple[str, ...] | None = None  # not read yet
        self._is_golden_unpackaged: bool | None = None
        self._stored = FinishedRuns()
        self._unproved = UnprovedRuns(folder.path, folder.head.plan_of_lines, worker_name)

    def find(self, experiment: Experiment, mutant: Mutant) -> FinishedRun | None:
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
                and self._versions_of(run.packages) == run.packages
            )

        return self._stored.find(self._key_of(experiment, mutant), is_usable)

    def note(self, finished: RecordedExperiment) -> None:
        """Note what a run gave, for the store."""
        mutant, record = finished.mutant, finished.record
        if not self._is_in_use or mutant is None or finished.is_reused or not is_storable(record):
            return
        modules = _modules_outside(mutant, finished.third_party_modules)
        packages = self._packages_of(modules)
        if self._has_unpackaged(modules) or not packages <= self._version_by_package.keys():
            return  # it loaded code that can change
        series = finished.series.faulty_bytes if finished.series else None
        run = FinishedRun(
            record=record,
            packages=self._versions_of(packages),
            surroundings=self._surroundings,
            faulty_series=series,
        )
        self._unproved.append(self._key_of(finished.experiment, mutant), run)

    def note_new_goldens(self) -> None:
        """Note that the run folder has more golden runs, which can have loaded more packages."""
        self._golden_packages = self._is_golden_unpackaged = None

    def close(self) -> None:
        self._unproved.close()

    def _key_of(self, experiment: Experiment, mutant: Mutant) -> str:
        golden_digest = self._golden_digest_of(experiment)
        return run_key(self._surroundings, experiment, mutant.tree_digest, golden_digest)

    def _versions_of(self, packages: Iterable[str]) -> dict[str, str | None]:
        return {name: self._version_by_package.get(name) for name in packages}

    def _packages_of(self, modules: Collection[str]) -> set[str]:
        """Return the packages of these modules, which a run loaded, and of its golden run."""
        if self._golden_packages is None:
            self._golden_packages = packages_loaded_by_golden_runs(RunFolder(self._run_path))
        return {*self._golden_packages, *(run_environment.packages_of_modules(modules) if modules else ())}

    def _has_unpackaged(self, modules: Collection[str]) -> bool:
        """Whether no package provides one of these modules, or one that a golden run loaded."""
        if self._is_golden_unpackaged is None:
            self._is_golden_unpackaged = bool(unpackaged_modules_of_golden_runs(RunFolder(self._run_path)))
        return self._is_golden_unpackaged or bool(run_environment.modules_without_package(modules))


def _modules_outside(mutant: Mutant, modules: Iterable[str]) -> set[str]:
    return {*modules} - {path.partition("/")[0].removesuffix(".py") for path in mutant.files}


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
