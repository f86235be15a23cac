"""What any worker keeps open, in a bench, in a pytest session or on a cluster: its engine, its golden runs,
and the independent engine of the proof.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from mutator._common import cache_layout_and_pruning
from mutator.engines.engine_choice import make_engine
from mutator.engines.engine_jobs import Engine, EngineArguments
from mutator.engines.reference_engine import ReferenceEngine
from mutator.execution.experiment_runner import (
    ExperimentRunner,
    FindCopiedRun,
    RecordedExperiment,
    find_nothing,
)
from mutator.execution.golden_hazards import GoldenHazardRules
from mutator.execution.inactivity_check import InactivityCheck
from mutator.execution.loaded_goldens import LoadedGoldens
from mutator.model import Experiment


class WorkerRunners:
    """Runs experiments on the engine `engine_name`, and again on an independent engine for the proof.

    `golden_folder_of` finds the golden run of an experiment; `digest_by_golden` has the digests of their
    files by key, and can grow. `find_copied_run` and `find_proof` find what need not run, there and for the
    proof. The engine is made at once, so that what it lacks is known before any work.
    """

    def __init__(
        self,
        arguments: EngineArguments,
        engine_name: str,
        *,
        golden_folder_of: Callable[[Experiment], Path],
        digest_by_golden: Mapping[str, str],
        has_seeded_goldens: bool,
        scenario_file: Callable[[str], Path],
        with_series: bool,
        golden_hazard_rules: GoldenHazardRules,
        find_copied_run: FindCopiedRun = find_nothing,
        find_proof: FindCopiedRun = find_nothing,
    ) -> None:
        self._arguments, self._manifest = arguments, arguments.manifest
        self._golden_folder_of, self._digest_by_golden = golden_folder_of, digest_by_golden
        self._has_seeded_goldens, self._scenario_file = has_seeded_goldens, scenario_file
        self._golden_hazard_rules = golden_hazard_rules
        self._runner = self._make_runner(
            make_engine(engine_name, arguments), with_series=with_series, find_copied_run=find_copied_run
        )
        self._find_proof = find_proof
        self._prover: ExperimentRunner | None = None
        self._current_seed: int | None = None  # the seed being run

    def run(self, experiments: Sequence[Experiment]) -> Iterator[RecordedExperiment]:
        """Yield what each experiment gave; there is at least one."""
        self.note_seed(experiments[0].seed)
        yield from self._runner.run(experiments)

    def prove(self, experiments: Sequence[Experiment]) -> Iterator[RecordedExperiment]:
        """Yield what each experiment gives on the reference engine, without data of other runs, because the
        proof must also detect errors in such data; but those that `find_proof` finds do not run.
        """
        if self._prover is None:
            arguments = self._arguments
            engine = ReferenceEngine(
                self._manifest,
                arguments.work_folder,
                arguments.limits,
                arguments.parent_pid,
                independent=True,
            )
            self._prover = self._make_runner(engine, find_copied_run=self._find_proof)
        yield from self._prover.run(experiments)

    def note_seed(self, seed: int) -> None:
        """Delete images of earlier seeds, which would fill the disk."""
        if self._has_seeded_goldens and seed != self._current_seed:
            cache_layout_and_pruning.prune_target_cache(self._manifest.cache_name)
        self._current_seed = seed

    def close(self) -> None:
        """End the processes that the engines keep between runs."""
        for runner in (self._runner, self._prover):
            if runner is not None:
                runner.close()

    def _make_runner(
        self,
        engine: Engine,
        *,
        with_series: bool = False,
        find_copied_run: FindCopiedRun,
    ) -> ExperimentRunner:
        goldens = LoadedGoldens(
            self._manifest,
            self._golden_folder_of,
            several_seeds=self._has_seeded_goldens,
            digests=self._digest_by_golden,
        )
        return ExperimentRunner(
            self._manifest,
            self._arguments.models,
            engine,
            goldens,
            self._scenario_file,
            golden_hazard_rules=self._golden_hazard_rules,
            with_series=with_series,
            inactivity_check=InactivityCheck(self._arguments),
            find_copied_run=find_copied_run,
        )
