"""Golden runs of families, each driven once, in a fork of the loaded target.

A family has many scenarios, so most are driven once: by a null mutant, as the fork engine drives mutants.
Some are also driven on the reference engine, twice and as a null mutant, as every golden run of the library's
scenarios is. These, and that a difference in one of them stops the family, are what the others rely on.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock, get_ident

from mutator._common.confined_files import path_below
from mutator._common.hashing import digest
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.fork_engine import ForkEngine
from mutator.errors import ForkServerLost, NotForkable
from mutator.limits import Limits
from mutator.mutants.mutant_building import Mutant
from mutator.store.golden_runs import GoldenRun
from mutator.store.planned_scenarios import PlannedScenarios
from mutator.targets.manifest import TargetManifest

_LEAST_DRIVEN_ON_REFERENCE = 20  # of all golden runs of families
_SHARE_ON_REFERENCE = 0.01


def runs_driven_once(
    golden_runs: Sequence[GoldenRun], planned: PlannedScenarios | None, seed: int
) -> frozenset[GoldenRun]:
    """Return the golden runs of families that are driven in a fork only: all but one in a hundred, at least
    20, drawn by the plan's seed, and the first of each family.
    """
    if planned is None:
        return frozenset()
    of_families = [run for run in golden_runs if run.scenario in planned.by_name]
    drawn = sorted(of_families, key=lambda run: digest([seed, run.key]))
    count = max(_LEAST_DRIVEN_ON_REFERENCE, round(len(of_families) * _SHARE_ON_REFERENCE))
    first_of_family: dict[str, GoldenRun] = {}
    for run in of_families:
        first_of_family.setdefault(planned.by_name[run.scenario].scenario.family, run)
    return frozenset(of_families) - set(drawn[:count]) - set(first_of_family.values())


@dataclass(slots=True)
class ForkedGoldenRuns:
    """Fork servers for golden runs, one for each thread that drives."""

    make_engine: Callable[[int], ForkEngine]  # by the number of the thread
    _engines: dict[int, ForkEngine]
    _lock: Lock

    @classmethod
    def of_target(
        cls, manifest: TargetManifest, work_folder: Path, limits: Limits, null_mutant: Mutant
    ) -> "ForkedGoldenRuns":
        def make_engine(number: int) -> ForkEngine:
            folder = path_below(work_folder, f"forks-{number}")
            folder.mkdir(parents=True, exist_ok=True)
            return ForkEngine(manifest, folder, limits, null_mutant=null_mutant)

        return cls(make_engine, {}, Lock())

    def drive(self, job: Job) -> tuple[ForkEngine, JobResult]:
        """Drive a golden run; return the engine, whose folder has the output, and the result.

        NotForkable if this cannot be done, also if a server has been lost twice.
        """
        engine = self._engine_of_thread()
        try:
            return engine, engine.drive_fault_free(job)
        except ForkServerLost:
            engine.close()
        try:
            return engine, engine.drive_fault_free(job)
        except ForkServerLost as why:
            engine.close()
            raise NotForkable(str(why)) from None

    def close(self) -> None:
        """End the servers."""
        for engine in self._engines.values():
            engine.close()

    def _engine_of_thread(self) -> ForkEngine:
        thread = get_ident()
        with self._lock:
            if thread not in self._engines:
                self._engines[thread] = self.make_engine(len(self._engines))
            return self._engines[thread]


def describe_family_runs(runs: Collection[GoldenRun], once: Collection[GoldenRun]) -> str:
    """Return how the golden runs of a family were driven, as the detail of their check."""
    more = len(runs) - len([run for run in runs if run in once])
    return f"{len(runs)} golden runs, {more} of them also twice and as null mutant on the reference engine"
