"""The fork engine: each mutant is a fork of its golden run, made just before the fault is first active.

Results equal the reference engine's byte for byte. The reference engine runs mutants that cannot be forked,
and reruns those that crash, but for crashes of confirmed kinds (`crashes_in_forks`). The `warm` engine
forks before the first step. So does this engine if a run stops at its first terminal hazard and the golden
run reaches one before the fault is active.
"""

import marshal
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from secrets import token_bytes

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import raising_disk_full, remove_anything_at, remove_folder
from mutator._common.message_text import counted
from mutator.engines.authenticated_files import AuthenticatedFiles
from mutator.engines.code_swap_planning import CodeSwap, plan_swap
from mutator.engines.crashes_in_forks import CrashKinds, is_same_crash
from mutator.engines.engine_jobs import (
    MOST_WAITING_PROCESSES,
    EngineArguments,
    Job,
    JobResult,
    RunMode,
    harness_error_result,
)
from mutator.engines.first_activation import ForkPoint, GoldenObservations, find_fork_point
from mutator.engines.fork_messages import SharedParts, fork_request
from mutator.engines.fork_results import ForkResults, golden_result_of_inactive_fault
from mutator.engines.fork_server_processes import (
    ForkServer,
    GoldenRunRequest,
    WaitingProcess,
    raising_if_server_input_changes,
    tree_folder_of_server,
)
from mutator.engines.golden_run_keys import GoldenRunKey, golden_run_id, golden_run_key, resolved_path
from mutator.engines.job_folder import PLAIN_OUTPUT_FOLDER, JobFolder, can_be_disturbance, ensure_work_folder
from mutator.engines.observation_store import ObservationStore, observations_of_watched_run
from mutator.engines.process_endings import GUARD_PATIENCE_S, ProcessEnding, without_run_specifics
from mutator.engines.received_fork_output import ReceivedForkOutput
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.thread_messages import describe_too_many_threads, remedy_for_threads
from mutator.errors import ForkServerLost, MutantNotSwappable, NotForkable
from mutator.limits import Limits
from mutator.model import Status
from mutator.mutants.mutant_building import Mutant, build
from mutator.mutants.probe_contract import ProbeSource
from mutator.targets.manifest import TargetManifest
from mutator.triggers.trigger_kinds import always_trigger


class ForkEngine:
    """Takes the arguments of ReferenceEngine, the null mutant, and a `secret` as in `EngineArguments`.

    In a sandbox, the fork server and its mutants can write only to the folder that `run` uses.
    """

    def __init__(
        self,
        manifest: TargetManifest,
        work_folder: Path,
        limits: Limits,
        parent_pid: int | None = None,
        *,
        null_mutant: Mutant,
        before_first_step: bool = False,
        secret: bytes = b"",
        most_waiting_processes: int = MOST_WAITING_PROCESSES,
    ) -> None:
        self.reference = ReferenceEngine(manifest, work_folder, limits, parent_pid)
        self._manifest = manifest
        self._limits = limits
        self._work_folder = self.reference.work_folder
        self._runs_folder = self._work_folder / f"{os.getpid()}-fork"
        self._parent_pid = parent_pid
        self._null_mutant = null_mutant
        self._forks_before_first_step = before_first_step
        self._most_waiting_processes = most_waiting_processes
        secret = secret or token_bytes(16)
        self._observation_store = ObservationStore(self._work_folder, secret)
        self._crash_kinds = CrashKinds(AuthenticatedFiles(self._work_folder, secret))
        mode = RunMode.WARM if before_first_step else RunMode.FORK
        self._results = ForkResults(limits, self._work_folder, mode)
        self._patience_s = limits.wall_s + GUARD_PATIENCE_S
        self._server: ForkServer | None = None
        self._server_count = 0
        self._shared_parts = SharedParts(None)
        self._obstacle = (
            None if manifest.stepwise_function else NotForkable(f"target {manifest.name} is not stepwise")
        )
        self._observations_by_golden: dict[
            GoldenRunKey, GoldenObservations | NotForkable
        ] = {}  # observations, or why there are none

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, JobResult]]:
        for job in jobs:
            folder = self._runs_folder / job.name
            try:
                yield job, self.execute(job, folder)
            finally:
                remove_folder(folder)
                remove_folder(self.reference.folder_of_job(job))

    def execute(self, job: Job, folder: Path) -> JobResult:
        """Run one job in the new scratch folder `folder` or, if it cannot be forked, on the reference engine.

        The reference engine has another folder, which also gets the output: mutants of the fork server can
        write beside their own one, so a link could be in its place.
        """
        try:
            with raising_disk_full(self._work_folder):
                result = self._execute_by_fork(job, folder)
        except (MutantNotSwappable, NotForkable) as why:
            return self._run_on_reference_engine(job, without_run_specifics(str(why), folder))
        except ForkServerLost as why:
            self.close()
            return harness_error_result(str(why), folder / PLAIN_OUTPUT_FOLDER, RunMode.FORK)
        except OSError as err:
            if not can_be_disturbance(err):
                raise
            self.close()
            return self._run_on_reference_engine(
                job, f"its folders were changed during the run ({err.strerror})"
            )
        if result.crash_kind and not self._crash_kinds.is_confirmed(result.crash_kind):
            return self._confirm_crash(job, result)
        return result

    def _confirm_crash(self, job: Job, of_fork: JobResult) -> JobResult:
        assert of_fork.exception is not None and of_fork.crash_kind is not None
        reason = f"ended as crashed: {of_fork.exception.description_without_place}"
        result = self._run_on_reference_engine(job, reason)
        self._crash_kinds.note(of_fork.crash_kind, is_same=is_same_crash(of_fork, result))
        return result

    def _run_on_reference_engine(self, job: Job, fallback_reason: str) -> JobResult:
        another = self.reference.folder_of_job(job)
        remove_anything_at(another)
        return replace(self.reference.execute(job, another), fallback_reason=fallback_reason)

    def find_obstacle_in_golden_run(self, job: Job) -> NotForkable | None:
        """Return why a job's golden run cannot be forked up to its last step; None if it can."""
        assert job.golden_folder is not None
        try:
            if self._obstacle:
                raise NotForkable(*self._obstacle.args)
            steps = len(self._golden_observations(job, job.golden_folder).counts_before_steps)
            swap = self._plan_swap(job, self._null_mutant.files, self._null_mutant.probe_source)
            waiting = self._process_before_step(job, steps - 1, swap)
            reply, _ = waiting.send_request({"do": "load", "modules": []}, self._patience_s)
            if reply["threads"]:
                raise NotForkable(
                    describe_too_many_threads(reply["threads"]), remedy_for_threads(reply["threads"])
                )
        except NotForkable as why:
            return why
        except ForkServerLost as why:
            return NotForkable(str(why))
        return None

    def close(self) -> None:
        if self._server is not None:
            self._server.close()
            self._server = None
            remove_folder(self._runs_folder)

    def _execute_by_fork(self, job: Job, folder: Path) -> JobResult:
        if self._obstacle:
            raise NotForkable(*self._obstacle.args)
        # the server has started with one hash seed, which its forks cannot change
        if job.probe_source is None or job.golden_folder is None or job.hash_seed:
            raise NotForkable("not an experiment")
        swap = self._plan_swap(job, job.changed_files, job.probe_source)
        if self._forks_before_first_step:
            return self._fork_before_first_step(job, folder, swap)
        observations = self._golden_observations(job, job.golden_folder)
        fork_point = find_fork_point(job.probe_source, observations)
        if job.stop_at_hazard and job.golden_end is not None:
            step_count = len(observations.counts_before_steps)
            if fork_point is None or not job.golden_end.is_after_step(fork_point.step, step_count):
                # the run stops before the fault is active, and so before a fork
                return self._fork_before_first_step(job, folder, swap)
        if fork_point is None:
            return golden_result_of_inactive_fault(job, job.golden_folder, observations.executed_functions)
        return self._run_in_fork(
            self._process_before_step(job, fork_point.step, swap), job, folder, swap, fork_point
        )

    def _plan_swap(self, job: Job, files: Mapping[str, bytes], probe: ProbeSource) -> CodeSwap:
        return plan_swap(self._manifest, files, probe, str(self._ensure_server(job).tree_folder))

    def _fork_before_first_step(self, job: Job, folder: Path, swap: CodeSwap) -> JobResult:
        first = self._ensure_server(job).first_process
        first.load_modules(_modules_to_load(swap), self._patience_s)
        return self._run_in_fork(first, job, folder, swap, _BEFORE_FIRST_STEP)

    def _ensure_server(self, job: Job) -> ForkServer:
        scenarios = Path(resolved_path(job.scenario)).parent
        if self._server is None:
            self._server_count += 1
            home = self._runs_folder / f"server-{self._server_count}"
            self._shared_parts = self._find_shared_parts(tree_folder_of_server(home))
            try:
                self._server = ForkServer(
                    self._manifest,
                    home,
                    self._parent_pid,
                    scenarios,
                    self._shared_parts.as_message(),
                    most_waiting_processes=self._most_waiting_processes,
                )
            except NotForkable as why:
                self._obstacle = why
                raise
        if self._manifest.sandbox and self._server.scenarios_folder != scenarios:
            raise NotForkable("the sandbox of the fork server has the scenarios of another folder")
        return self._server

    def _find_shared_parts(self, tree: Path) -> SharedParts:
        null = self._null_mutant
        try:
            return SharedParts(plan_swap(self._manifest, null.files, null.probe_source, str(tree)))
        except MutantNotSwappable:  # nothing will be forked
            return SharedParts(None)

    def _process_before_step(self, job: Job, step: int, swap: CodeSwap) -> WaitingProcess:
        pool = self._ensure_server(job)
        key = golden_run_key(job)
        golden = GoldenRunRequest(
            key=key, scenario=job.scenario, arguments=lambda: self._target_arguments(job, pool.scratch_folder)
        )
        observations = self._observations_by_golden.get(key)
        libraries = observations.imported_modules if isinstance(observations, GoldenObservations) else ()
        return pool.process_before_step(step, golden, [*libraries, *_modules_to_load(swap)], self._patience_s)

    def _target_arguments(self, job: Job, out: Path) -> list[str]:
        return list(
            self._manifest.run_arguments(
                scenario=job.scenario.resolve(), seed=job.seed, out=out, changes=job.scenario_changes
            )
        )

    def _run_in_fork(
        self,
        waiting: WaitingProcess,
        job: Job,
        folder: Path,
        swap: CodeSwap,
        fork_point: ForkPoint,
        observe: bool = False,
    ) -> JobResult:
        ensure_work_folder(self._work_folder)
        with JobFolder(folder) as home:
            ended, output = self._fork_and_wait(waiting, job, home, swap, fork_point, observe)
            with output:
                place = self.reference.folder_of_job(job) / PLAIN_OUTPUT_FOLDER
                result = self._results.result_of(job, home, ended, output, place, observe=observe)
            return replace(result, fork_step=fork_point.step)

    def _fork_and_wait(
        self,
        waiting: WaitingProcess,
        job: Job,
        home: JobFolder,
        swap: CodeSwap,
        fork_point: ForkPoint,
        observe: bool,
    ) -> tuple[ProcessEnding, ReceivedForkOutput]:
        request = fork_request(
            self._manifest,
            self._limits,
            home,
            swap,
            self._shared_parts,
            fork_point,
            stop_source=job.stop_source(self._manifest),
            observe=observe,
        )
        # the child must begin the run; a watched run has the arguments of the waiting processes
        if waiting.key is None:
            request["args"] = self._target_arguments(
                job, self._ensure_server(job).scratch_folder if observe else home.output_folder
            )
        limits = {"wall_s": self._limits.wall_s, "disk_mb": self._limits.disk_mb}
        # a sandbox's /tmp is beside the run's folder
        limited_folder = self._runs_folder if self._manifest.sandbox else home.path
        message = {"do": "mutant", "job": marshal.dumps(request), "home": str(limited_folder), **limits}
        with nullcontext() if waiting.key else raising_if_server_input_changes(job.scenario):
            reply, handles = waiting.send_request(message, self._patience_s)
        self._ensure_server(job).clear_sandbox_temporary_folders()
        if reply["threads"]:
            raise NotForkable(
                describe_too_many_threads(reply["threads"]), remedy_for_threads(reply["threads"])
            )
        if count := reply["processes"]:
            started = f"it has started {counted(count, 'process', 'processes')}, which forks would share"
            raise NotForkable(started, "do the work of other processes in the step itself")
        output = ReceivedForkOutput(*handles)
        if reply["touched"]:
            with output:
                self.close()
            raise NotForkable("it writes into its own tree")
        return ProcessEnding(**{name: reply[name] for name in ProcessEnding.__slots__}), output

    def _golden_observations(self, job: Job, golden: Path) -> GoldenObservations:
        """Return what a probe observes in a job's golden run; it runs if no check has stored that."""
        key = golden_run_key(job)
        if key not in self._observations_by_golden:
            try:
                self._observations_by_golden[key] = self._observe_golden_run(job, golden)
            except NotForkable as why:
                self._observations_by_golden[key] = why
        observations = self._observations_by_golden[key]
        if isinstance(observations, NotForkable):
            raise NotForkable(*observations.args)
        return observations

    def _observe_golden_run(self, job: Job, golden: Path) -> GoldenObservations:
        golden_id = golden_run_id(job)
        if stored := self._observation_store.load(golden_id):
            return stored
        execution = self.drive_fault_free(job)
        if execution.status is not Status.OK:
            raise NotForkable(f"its golden run ended as {execution.status.value}: {execution.detail}")
        for name in self._manifest.output_files:
            if read_bounded(execution.out / name) != read_bounded(golden / name):
                raise NotForkable(f"its {name} differs when it is driven step by step")
        observations = observations_of_watched_run(execution)
        if observations.has_any_before_first_step:
            raise NotForkable("it observes before its first step")
        self._observation_store.save(golden_id, observations)
        return observations

    def drive_fault_free(self, job: Job) -> JobResult:
        """Drive a golden run in a fork of the loaded target, with a probe that observes it.

        The output is in the folder of the reference engine. NotForkable if the target or this run cannot be
        forked.
        """
        folder = self._runs_folder / f"watch-{golden_run_id(job)}"
        if self._obstacle:
            raise NotForkable(*self._obstacle.args)
        try:
            swap = self._plan_swap(job, self._null_mutant.files, self._null_mutant.probe_source)
        except MutantNotSwappable as why:
            raise NotForkable(f"its observing statement cannot be inserted: {why}") from None
        null = replace(job, mutant_id=None, stop_at_hazard=False)
        self._process_before_step(job, 0, swap)  # NotForkable, with the reason, if the run cannot begin
        # Fork before the first step, because a later fork misses earlier observations.
        first = self._ensure_server(job).first_process
        try:
            execution = self._run_in_fork(first, null, folder, swap, _BEFORE_FIRST_STEP, observe=True)
        finally:
            remove_folder(folder)
        if execution.status is Status.HARNESS_ERROR:
            raise ForkServerLost(execution.detail)
        return execution


_BEFORE_FIRST_STEP = ForkPoint(step=0, observation_count=0, earliest_time_s=None, last_time_s=None)


def _modules_to_load(swap: CodeSwap) -> list[str]:
    return [*dict.fromkeys(function.module for function in swap.functions), *swap.imported_modules]


def make_fork_engine(arguments: EngineArguments) -> ForkEngine:
    return _make_engine(arguments, before_first_step=False)


def make_warm_engine(arguments: EngineArguments) -> ForkEngine:
    return _make_engine(arguments, before_first_step=True)


def _make_engine(arguments: EngineArguments, *, before_first_step: bool) -> ForkEngine:
    null = build(arguments.manifest, arguments.models, None, always_trigger())
    return ForkEngine(
        arguments.manifest,
        arguments.work_folder,
        arguments.limits,
        arguments.parent_pid,
        null_mutant=null,
        before_first_step=before_first_step,
        secret=arguments.secret,
        most_waiting_processes=arguments.most_waiting_processes,
    )
