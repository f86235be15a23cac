"""The runs of the checks before a campaign: golden runs, null mutants, the canary.

One run proves several things. A null mutant is driven under another hash seed and, if the target can, step by
step. If its output is the golden run's, then neither the repetition, nor the hash seed, nor the probe, nor
the way of driving changes anything. Only if it is not, further runs find out which of them does.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from mutator._common import cache_layout_and_pruning
from mutator._common.confined_files import path_below
from mutator._common.files import remove_folder
from mutator.campaigns.campaign_files import Campaign
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.golden_run_keys import golden_run_id
from mutator.engines.observation_store import ObservationStore, observations_of_watched_run
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.run_limits import measure_limits
from mutator.errors import NotForkable
from mutator.limits import Limits
from mutator.model import Experiment, Status
from mutator.mutants.mutant_building import Mutant, build
from mutator.preflight import canary_check, unreached_triggers
from mutator.preflight.check_run_problems import CheckRun, null_mutant_problem, read_check_run
from mutator.preflight.forked_golden_runs import ForkedGoldenRuns, runs_driven_once
from mutator.store.golden_files import GOLDEN_FOLDER, pack_golden
from mutator.store.golden_runs import GoldenRun
from mutator.store.run_progress import Progress, StagePace
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger
from mutator.workspace import Workspace

GOLDEN, GOLDEN_AGAIN, NULL_MUTANT, CANARY = "golden", "golden again", "null mutant", "canary"
FORKED = "forked"  # a golden run of a family, in a fork of the loaded target
_OTHER_HASH_SEED = 4242  # any but 0, with which golden runs are made: the order of sets of strings differs

OnProgress = Callable[[Progress], None]
CheckRunByName = dict[tuple[str, Any], CheckRun]  # kind of run, and `GoldenRun`


@dataclass(frozen=True, kw_only=True)
class CheckRunner:
    """Executes the runs that the checks judge; golden runs and observations stay in `pending_folder`."""

    workspace: Workspace
    manifest: TargetManifest
    campaign: Campaign
    golden_runs: Sequence[GoldenRun]
    seed: int  # of golden runs whose key has none
    canary_experiment: Experiment | None  # MutatorError if its golden run has a hazard
    scratch_folder: Path
    pending_folder: Path
    observation_store: ObservationStore | None = (
        None  # from which fork engines take what null mutants observe
    )
    dropped: frozenset[GoldenRun] = frozenset()  # golden runs of which only the verdict is kept
    with_forks: bool = False  # whether most golden runs of families are driven once, in a fork

    def run_all(
        self, workers: int, notify: OnProgress
    ) -> tuple[CheckRunByName, canary_check.CanaryVerdict | None]:
        """Do all runs of all checks, `workers` at a time. Return them with the verdict on a canary."""
        with self.engine_and_pool(workers) as (engine, pool):
            futures = {
                name: pool.submit(self.run_job, engine, name, job)
                for name, job in self.jobs_by_name().items()
            }
            # last, because it waits for the golden runs, which have then begun
            judged = pool.submit(self._judge_canary_after_goldens, engine, futures)
            nulls = [future for name, future in futures.items() if name[0] == NULL_MUTANT]
            goldens = [future for name, future in futures.items() if name[0] == GOLDEN]
            if forked := [future for name, future in futures.items() if name[0] == FORKED]:
                _report_progress("golden", forked, notify)  # by far the most
            _report_progress("checks", [judged, *nulls], notify)
            _report_progress("golden", goldens, notify)
            runs = {name: future.result() for name, future in futures.items()}
            for key in self.golden_runs:
                runs |= self.repetitions(engine, key, runs)
            return runs, judged.result()

    def repeat_goldens(self, workers: int, notify: OnProgress) -> dict[str, CheckRun]:
        """Do each golden run once, as null mutant; return the runs by key."""
        jobs = {
            name: job
            for name, job in self.jobs_by_name().items()
            if name[0] == (FORKED if name[1] in self.driven_once else NULL_MUTANT)
        }
        with self.engine_and_pool(workers) as (engine, pool):
            futures = {
                name[1].key: pool.submit(self.run_job, engine, name, job) for name, job in jobs.items()
            }
            _report_progress("golden", [*futures.values()], notify)
            return {key: future.result() for key, future in futures.items()}

    def repetitions(self, engine: ReferenceEngine, key: GoldenRun, runs: CheckRunByName) -> CheckRunByName:
        """Return the runs that stand for the repeated golden run and the null mutant: the one that there is
        or, if it is not sound, two that tell causes apart.
        """
        if key in self.driven_once:
            once = runs[FORKED, key]
            return {(GOLDEN, key): once, (GOLDEN_AGAIN, key): once, (NULL_MUTANT, key): once}
        first, null = runs[GOLDEN, key], runs[NULL_MUTANT, key]
        if first.problem or not null_mutant_problem(first, null):
            return {(GOLDEN_AGAIN, key): null}
        if self.observation_store:
            self.observation_store.remove(golden_run_id(self._null_job(key)))
        common, null_job = self._common_of_jobs(key), self._null_job(key)
        jobs = {
            (GOLDEN_AGAIN, key): Job(name=f"b-{key.key}", hash_seed=_OTHER_HASH_SEED, **common),
            (NULL_MUTANT, key): replace(null_job, name=f"m-{key.key}", hash_seed=0, drive_step_by_step=False),
        }
        return {name: self.run_job(engine, name, job) for name, job in jobs.items()}

    @contextmanager
    def engine_and_pool(self, workers: int) -> Iterator[tuple[ReferenceEngine, ThreadPoolExecutor]]:
        work = self.scratch_folder / "checks"
        for scratch in (work, self.pending_folder):
            remove_folder(scratch)
        work.mkdir(parents=True)
        pool = ThreadPoolExecutor(max(1, workers))
        try:
            yield ReferenceEngine(self.manifest, work, self.campaign.golden_run_limits), pool
        finally:
            pool.shutdown(cancel_futures=True)
            if self.forked_golden_runs:
                self.forked_golden_runs.close()
            remove_folder(work)

    def measure_limits(self, golden_runs: Iterable[CheckRun]) -> Limits:
        """Return the limits of faulty runs, measured if the campaign leaves them to the golden runs."""
        campaign = self.campaign
        return measure_limits(
            campaign.limits, campaign.measured_limit_names, [run.cpu_s for run in golden_runs]
        )

    def _judge_canary_after_goldens(
        self, engine: ReferenceEngine, futures: Mapping[tuple[str, Any], Future[CheckRun]]
    ) -> canary_check.CanaryVerdict | None:
        goldens = {name: future.result() for name, future in futures.items() if name[0] == GOLDEN}
        self.check_golden_run_of_canary(goldens)
        return self.judge_canary(engine, self.measure_limits(goldens.values()))

    def check_golden_run_of_canary(self, runs: CheckRunByName) -> None:
        """Raise MutatorError if the golden run of the canary is among `runs` and has a hazard: its canary
        would prove nothing.
        """
        canary, golden_run = self.canary_experiment, self.canary_golden_run
        run = runs.get((GOLDEN, golden_run))
        if canary is not None and golden_run is not None and run is not None and run.hazards:
            raise canary_check.golden_hazard_error(self.campaign, golden_run.key, run.hazards)

    @cached_property
    def canary_golden_run(self) -> GoldenRun | None:
        """The golden run of the canary; None without a canary."""
        canary = self.canary_experiment
        several_seeds = any(golden_run.seed is not None for golden_run in self.golden_runs)
        return GoldenRun.for_experiment(canary, several_seeds=several_seeds) if canary else None

    def judge_canary(self, engine: ReferenceEngine, limits: Limits) -> canary_check.CanaryVerdict | None:
        """Run the canary with the limits of faulty runs; None without one."""
        experiment, facts = self.canary_experiment, self.campaign.canary
        if experiment is None or facts is None:
            return None
        canary_engine = ReferenceEngine(self.manifest, engine.work_folder, limits)

        def run(experiment: Experiment) -> CheckRun:
            return self.run_job(
                canary_engine,
                (CANARY, None),
                canary_check.build_canary_job(self.workspace, self.manifest, experiment),
            )

        return canary_check.run_until_hazard(
            canary_check.canary_with_other_values(self.workspace, self.manifest, experiment),
            run,
            facts.hazard,
        )

    def jobs_by_name(self) -> dict[tuple[str, Any], Job]:
        # null mutants first: their stage is reported before that of the golden runs
        twice = [key for key in self.golden_runs if key not in self.driven_once]
        nulls = {(NULL_MUTANT, key): self._null_job(key) for key in twice}
        goldens = {(GOLDEN, key): Job(name=f"a-{key.key}", **self._common_of_jobs(key)) for key in twice}
        forked = {
            (FORKED, key): replace(self._null_job(key), name=f"f-{key.key}", hash_seed=0)
            for key in self.golden_runs
            if self.forked_golden_runs and self._is_of_family(key)
        }
        return nulls | goldens | forked

    @cached_property
    def driven_once(self) -> frozenset[GoldenRun]:
        """The golden runs that are driven in a fork only."""
        if not self.forked_golden_runs:
            return frozenset()
        return runs_driven_once(self.golden_runs, self.workspace.planned_scenarios, self.seed)

    def _is_of_family(self, key: GoldenRun) -> bool:
        planned = self.workspace.planned_scenarios
        return planned is not None and key.scenario in planned.by_name

    def runs_needed_of(self, key: GoldenRun) -> frozenset[tuple[str, Any]]:
        """Return the runs that must end before a golden run can be judged."""
        kinds = [] if key in self.driven_once else [GOLDEN, NULL_MUTANT]
        if self.forked_golden_runs and self._is_of_family(key):
            kinds.append(FORKED)
        return frozenset((kind, key) for kind in kinds)

    def _null_job(self, key: GoldenRun) -> Job:
        return Job(
            name=f"n-{key.key}",
            changed_files=self._null_mutant.files,
            mutant_id=self._null_mutant.id,
            keep_observations=True,
            hash_seed=_OTHER_HASH_SEED,
            drive_step_by_step=self.manifest.stepwise_function is not None,
            note_executed_functions=True,
            **self._common_of_jobs(key),
        )

    def _common_of_jobs(self, key: GoldenRun) -> dict[str, Any]:
        return {
            "scenario": self.workspace.scenario(key.scenario),
            "seed": self.seed if key.seed is None else key.seed,
            "scenario_changes": key.changes,
        }

    @cached_property
    def forked_golden_runs(self) -> ForkedGoldenRuns | None:
        """What drives golden runs of families; None if the reference engine drives all."""
        if not self.with_forks or not self.workspace.planned_scenarios or not self.manifest.stepwise_function:
            return None
        return ForkedGoldenRuns.of_target(
            self.manifest, self.scratch_folder / "checks", self.campaign.golden_run_limits, self._null_mutant
        )

    @cached_property
    def _null_mutant(self) -> Mutant:
        return build(self.manifest, self.workspace.fault_models(), None, always_trigger())

    def run_job(self, engine: ReferenceEngine, name: tuple[str, Any], job: Job) -> CheckRun:
        if name[0] == FORKED:
            return self._run_forked(engine, name[1], job)
        scratch = path_below(engine.work_folder, job.name)
        try:
            execution = engine.execute(job, scratch)
            run = read_check_run(self.manifest, execution)
            if name[0] == GOLDEN and name[1].seed is not None:
                cache_layout_and_pruning.prune_target_cache(self.manifest.cache_name)
            if name[0] == NULL_MUTANT and name[1] not in self.dropped:
                self._keep_observations(name[1], job, execution)
            if name[0] == GOLDEN and not run.problem and name[1] not in self.dropped:
                self._keep_output(name[1], execution)
            return run
        finally:
            remove_folder(scratch)

    def _run_forked(self, engine: ReferenceEngine, key: GoldenRun, job: Job) -> CheckRun:
        """Drive a golden run in a fork or, if it cannot be forked, as null mutant on the reference engine."""
        assert self.forked_golden_runs
        try:
            forks, execution = self.forked_golden_runs.drive(job)
            scratch = forks.reference.folder_of_job(job)
        except NotForkable:
            scratch = path_below(engine.work_folder, job.name)
            execution = engine.execute(job, scratch)
        try:
            run = read_check_run(self.manifest, execution)
            if key in self.driven_once and key not in self.dropped:
                self._keep_observations(key, job, execution)
                if not run.problem:
                    self._keep_output(key, execution)
            return run
        finally:
            remove_folder(scratch)

    def _keep_output(self, key: GoldenRun, execution: JobResult) -> None:
        golden = self.pending_folder / GOLDEN_FOLDER
        if self._is_of_family(key):
            pack_golden(execution.out, golden, key.key)
        else:
            golden.mkdir(parents=True, exist_ok=True)
            execution.out.rename(path_below(golden, key.key))

    def _keep_observations(self, key: GoldenRun, job: Job, execution: JobResult) -> None:
        unreached_triggers.save_observations(
            self.pending_folder, key.key, execution.watch_report.get("seen", ())
        )
        if self.observation_store and job.drive_step_by_step and execution.status is Status.OK:
            observations = observations_of_watched_run(execution)
            # a worker's fork engine finds and says why it cannot fork such a run
            if not (observations.has_any_before_first_step or execution.watch_report.get("threads")):
                self.observation_store.save(golden_run_id(job), observations)


def _report_progress(stage: str, futures: Collection[Future[Any]], notify: OnProgress) -> None:
    pace = StagePace(stage, len(futures))
    notify(pace.progress_at(0))
    for finished_count, future in enumerate(as_completed(futures), 1):
        future.result()
        notify(pace.progress_at(finished_count))
