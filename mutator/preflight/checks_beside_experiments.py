"""The checks before a campaign as a session runs them that does not wait for all of them.

The experiments of a golden run begin when its own checks have passed. Until all have, verdicts are
provisional. Each run of a check takes the place of a worker: `start_next` begins one when a core is free.
"""

from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack
from queue import SimpleQueue
from typing import Any

from mutator.errors import CheckFailed
from mutator.preflight.canary_check import CanaryVerdict
from mutator.preflight.check_judgements import golden_run_results
from mutator.preflight.check_run_problems import CheckRun
from mutator.preflight.preflight_check_runner import (
    CANARY,
    FORKED,
    GOLDEN,
    NULL_MUTANT,
    CheckRunByName,
    OnProgress,
)
from mutator.preflight.preflight_checks import PreflightChecks, raise_if_failed, run_checks
from mutator.store.golden_runs import GoldenRun
from mutator.store.preflight_results import CheckResult
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import StagePace
from mutator.workspace import Workspace

_ORDER = (NULL_MUTANT, GOLDEN, FORKED)  # of the runs of a golden run


def begin_checks(
    workspace: Workspace,
    folder: RunFolder,
    *,
    workers: int,
    notify: OnProgress,
    secret: bytes,
    with_forks: bool = False,
) -> "ChecksBesideExperiments | None":
    """Begin the checks of a run folder; the parameters are those of `run_checks`.

    None if there are none left: they had passed before, or limits of faulty runs follow from all golden runs,
    so that all had to run first. CheckFailed if one fails now.
    """
    checks = PreflightChecks(workspace, folder, secret, with_forks=with_forks)
    if "cpu_s" in checks.campaign.measured_limit_names:
        run_checks(workspace, folder, workers=workers, notify=notify, secret=secret, with_forks=with_forks)
        return None
    if checks.find_earlier_results(workers, notify) is not None:
        return None
    anchors = checks.judge_anchors()
    raise_if_failed(folder, [anchors])
    checks.remove_stored_results()  # they hold for other versions, and no longer once an experiment runs
    return ChecksBesideExperiments(checks, anchors, workers)


class ChecksBesideExperiments:
    """Deals the runs of the checks, golden run by golden run, in their order. `workers` may run at a time.

    Use it in one thread, which `on_end` is to wake: it is called in another one when a run has ended.
    """

    def __init__(self, checks: PreflightChecks, anchors: CheckResult, workers: int) -> None:
        self.workers = workers
        self.on_end: Callable[[], None] = lambda: None
        self.has_failed = False  # whether a check has failed, as far as they have been judged
        self._checks, self._anchors = checks, anchors
        self._runner = checks.build_check_runner(checks.pending_folder)
        self._canary_verdict: CanaryVerdict | None = None
        self._runs: CheckRunByName = {}
        self._open = ExitStack()
        self._engine, self._pool = self._open.enter_context(self._runner.engine_and_pool(workers))
        self._jobs = self._runner.jobs_by_name()
        self._waiting = deque(self._names_in_order())
        self.total = len(self._waiting)
        self._running: set[Future[Any]] = set()
        self._ended: SimpleQueue[tuple[tuple[str, Any], Future[Any]]] = SimpleQueue()

    @property
    def ended_count(self) -> int:
        """The number of runs that have ended."""
        return self.total - len(self._waiting) - len(self._running)

    @property
    def running(self) -> int:
        return len(self._running)

    @property
    def has_remaining(self) -> bool:
        """Whether any run has not ended."""
        return bool(self._waiting or self._running)

    @property
    def has_waiting(self) -> bool:
        return bool(self._waiting)

    def start_next(self) -> None:
        """Begin the next run."""
        name = self._waiting.popleft()
        future = self._pool.submit(self._do, name)
        self._running.add(future)
        future.add_done_callback(lambda future: self._note_end(name, future))

    def collect(self) -> dict[str, CheckRun]:
        """Take note of runs that have ended. Return the golden runs whose own checks have passed with them,
        by key; they are in the run folder now. Raises what a run raised, such as DiskFull.
        """
        passed = {}
        while not self._ended.empty():
            name, future = self._ended.get()
            self._running.discard(future)
            result = future.result()
            if name[0] == CANARY:
                self._canary_verdict = result
                self.has_failed |= bool(result and result.problem)
                continue
            self._runs[name] = result
            if self._runner.runs_needed_of(name[1]) <= self._runs.keys():
                if name[1] == self._runner.canary_golden_run and self._runs[GOLDEN, name[1]].hazards:
                    self.has_failed = True
                if self._is_sound(name[1]):
                    run = passed[name[1].key] = self._runs[GOLDEN, name[1]]
                    self._place(name[1], run.output_digest)
                else:
                    self.has_failed = True
        if not self.has_remaining and not self.has_failed:
            self.has_failed = not all(r.passed for r in self._checks.judge_equal_scenarios(self._runs))
        return passed

    def _place(self, golden_run: GoldenRun, output_digest: str) -> None:
        try:
            self._checks.place_golden_run(golden_run, output_digest)
        except CheckFailed:
            self.has_failed = True
            raise

    def finish(self, notify: OnProgress) -> None:
        """Do all runs that remain, judge them, and store what `run_checks` does; CheckFailed as there."""
        with self._open:
            self._complete(notify)
        results = self._checks.judge_and_store(self._anchors, self._runner, self._runs, self._canary_verdict)
        raise_if_failed(self._checks.folder, results)
        self._checks.store_in_cache()

    def _complete(self, notify: OnProgress) -> None:
        self.collect()
        pace = StagePace("checks", self.total, self.ended_count)
        wake: SimpleQueue[None] = SimpleQueue()
        self.on_end = lambda: wake.put(None)
        while self.has_remaining:
            notify(pace.progress_at(self.ended_count))
            while self._waiting and self.running < max(1, self.workers):
                self.start_next()
            if self._ended.empty():
                wake.get()
            self.collect()

    def close(self) -> None:
        """End what runs, and start no more."""
        self._waiting.clear()
        self._open.close()

    def _names_in_order(self) -> Iterator[tuple[str, Any]]:
        """Yield the runs of each golden run in turn, and the canary after the first."""
        for number, key in enumerate(self._runner.golden_runs):
            yield from sorted(self._runner.runs_needed_of(key), key=lambda name: _ORDER.index(name[0]))
            if number == 0:
                yield CANARY, None

    def _do(self, name: tuple[str, Any]) -> Any:
        if name[0] == CANARY:
            return self._runner.judge_canary(self._engine, self._runner.campaign.limits)
        return self._runner.run_job(self._engine, name, self._jobs[name])

    def _note_end(self, name: tuple[str, Any], future: Future[Any]) -> None:
        self._ended.put((name, future))
        self.on_end()

    def _is_sound(self, key: GoldenRun) -> bool:
        """Judge a golden run. What finds out why it is not sound runs at once: nothing else matters then."""
        self._runs |= self._runner.repetitions(self._engine, key, self._runs)
        return all(result.passed for result in golden_run_results(self._runs, key))
