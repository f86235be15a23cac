"""The fork engine: each mutant is a fork of its golden run, made just before the fault is first active.

Results equal the reference engine's byte for byte. The reference engine runs mutants that cannot be forked,
and reruns those that crash. The `warm` engine forks before the first step. So does this engine if a run stops
at its first terminal hazard and the golden run has one, too.
"""

import hmac
import marshal
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path
from secrets import token_bytes
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.files import (
    disk_full_error,
    raising_disk_full,
    remove_anything_at,
    remove_folder,
    write_atomic,
)
from mutator._common.hashing import content_id
from mutator.engines.code_swap import CodeSwap, plan_swap
from mutator.engines.engine_jobs import Execution, Job, RunMode, Setting, failed
from mutator.engines.first_activation import Observed, Start, first_active
from mutator.engines.fork_server_client import Golden, Pool, Waiting, used_unchanged
from mutator.engines.job_folder import OUTPUT, RunHome, is_disturbance, make_work
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.target_processes import (
    PATIENCE_S,
    Ended,
    is_full,
    judge,
    steady,
)
from mutator.engines.thread_messages import too_many, turned_off
from mutator.errors import ForkServerLost, NotForkable, NotSwappable
from mutator.model import Limits, Status
from mutator.mutants.mutant_building import Mutant, build
from mutator.mutants.probe import Probe, probe_module, probe_state_after, untriggered_report
from mutator.targets.manifest import TargetManifest
from mutator.targets.stop_code import stop_source
from mutator.triggers.trigger_kinds import always_trigger

_Key = tuple[str, int, tuple[str, ...]]


class ForkEngine:
    """Takes the arguments of ReferenceEngine; `null` is the null mutant, `secret` is as in `Setting`.

    In a sandbox, the fork server and its mutants can write only to the folder that `run` uses.
    """

    def __init__(
        self,
        manifest: TargetManifest,
        work: Path,
        limits: Limits,
        parent: int | None = None,
        *,
        null: Mutant,
        warm: bool = False,
        secret: bytes = b"",
    ) -> None:
        self.reference = ReferenceEngine(manifest, work, limits, parent)
        self._manifest = manifest
        self._limits = limits
        self._work = self.reference.work
        self._runs = self._work / f"{os.getpid()}-fork"
        self._parent = parent
        self._null = null
        self._warm = warm
        self._secret = secret or token_bytes(16)
        self._patience_s = limits.wall_s + PATIENCE_S
        self._pool: Pool | None = None
        self._pools = 0
        self._unfit = None if manifest.stepwise else NotForkable(f"target {manifest.name} is not stepwise")
        self._seen: dict[_Key, Observed | NotForkable] = {}  # observations, or why there are none

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Execution]]:
        for job in jobs:
            folder = self._runs / job.name
            try:
                yield job, self.execute(job, folder)
            finally:
                remove_folder(folder)
                remove_folder(self.reference.folder_of(job))

    def execute(self, job: Job, folder: Path) -> Execution:
        """Run one job in the new scratch folder `folder` or, if it cannot be forked, on the reference engine.

        The reference engine has another folder, which also gets the output: mutants of the fork server can
        write beside their own one, so a link could be in its place.
        """
        try:
            with raising_disk_full(self._work):
                return self._execute(job, folder)
        except (NotSwappable, NotForkable) as why:
            return self._by_reference(job, steady(str(why), folder))
        except ForkServerLost as why:
            self.close()
            return failed(str(why), folder / OUTPUT, RunMode.FORK)
        except OSError as err:
            if not is_disturbance(err):
                raise
            self.close()
            return self._by_reference(job, f"its folders were changed during the run ({err.strerror})")

    def _by_reference(self, job: Job, why: str) -> Execution:
        another = self.reference.folder_of(job)
        remove_anything_at(another)
        return replace(self.reference.execute(job, another), why=why)

    def refusal(self, job: Job) -> NotForkable | None:
        """Return why a job's golden run cannot be forked up to its last step; None if it can."""
        assert job.golden is not None
        try:
            if self._unfit:
                raise NotForkable(*self._unfit.args)
            steps = len(self._observed(job, job.golden).before)
            swap = self._swap(job, self._null.files, self._null.probe)
            waiting = self._at(job, steps - 1, swap)
            said, _ = waiting.ask({"do": "load", "modules": []}, self._patience_s)
            if said["threads"]:
                raise NotForkable(too_many(said["threads"]), turned_off(said["threads"]))
        except NotForkable as why:
            return why
        except ForkServerLost as why:
            return NotForkable(str(why))
        return None

    def close(self) -> None:
        if self._pool is not None:
            self._pool.close()
            self._pool = None
            remove_folder(self._runs)

    def _execute(self, job: Job, folder: Path) -> Execution:
        if self._unfit:
            raise NotForkable(*self._unfit.args)
        if job.probe is None or job.golden is None or job.hash_seed:
            raise NotForkable("not an experiment")
        swap = self._swap(job, job.files, job.probe)
        if self._warm:
            return self._from_the_start(job, folder, swap)
        seen = self._observed(job, job.golden)
        if job.stop and job.golden_ends:  # the run can stop before the fault is active, and so before a fork
            return self._from_the_start(job, folder, swap)
        start = first_active(job.probe, seen)
        if start is None:
            return _golden(job, job.golden)
        return self._become(self._at(job, start.step, swap), job, folder, swap, start)

    def _swap(self, job: Job, files: Mapping[str, bytes], probe: Probe) -> CodeSwap:
        return plan_swap(self._manifest, files, probe, str(self._running(job).tree))

    def _from_the_start(self, job: Job, folder: Path, swap: CodeSwap) -> Execution:
        first = self._running(job).first
        first.load(_needed(swap), self._patience_s)
        return self._become(first, job, folder, swap, _FROM_THE_START)

    def _running(self, job: Job) -> Pool:
        scenarios = Path(_resolved(job.scenario)).parent
        if self._pool is None:
            self._pools += 1
            home = self._runs / f"server-{self._pools}"
            try:
                self._pool = Pool(self._manifest, home, self._parent, scenarios)
            except NotForkable as why:
                self._unfit = why
                raise
        if self._manifest.sandbox and self._pool.scenarios != scenarios:
            raise NotForkable("the sandbox of the fork server has the scenarios of another folder")
        return self._pool

    def _at(self, job: Job, step: int, swap: CodeSwap) -> Waiting:
        pool = self._running(job)
        key = _key(job)
        golden = Golden(key=key, scenario=job.scenario, arguments=lambda: self._arguments(job, pool.home))
        seen = self._seen.get(key)
        libraries = seen.libraries if isinstance(seen, Observed) else ()
        return pool.before(step, golden, [*libraries, *_needed(swap)], self._patience_s)

    def _arguments(self, job: Job, out: Path) -> list[str]:
        return list(
            self._manifest.arguments(
                scenario=job.scenario.resolve(), seed=job.seed, out=out, changes=job.changes
            )
        )

    def _become(
        self, waiting: Waiting, job: Job, folder: Path, swap: CodeSwap, start: Start, watch: bool = False
    ) -> Execution:
        make_work(self._work)
        with RunHome(folder) as home:
            ended = self._forked(waiting, job, home, swap, start, watch)
            place = self.reference.folder_of(job) / OUTPUT
            return replace(self._judged(job, home, ended, place, watch), start=start.step)

    def _forked(
        self, waiting: Waiting, job: Job, home: RunHome, swap: CodeSwap, start: Start, watch: bool
    ) -> Ended:
        request = {
            "home": str(home.path),
            "out": str(home.out),
            "log": str(home.log),
            "report": str(home.report),
            "inactive": str(home.inactive),
            "args": None,
            "cpu_s": self._limits.cpu_s,
            "memory_mb": self._limits.memory_mb,
            "disk_mb": self._limits.disk_mb,
            "steps": self._limits.steps,
            "probe_name": probe_module(self._manifest.package),
            "probe": swap.probe,
            "functions": [(f.module, f.path, f.old, f.new) for f in swap.functions],
            "settings": swap.settings,
            "probe_state": probe_state_after(start.observed, start.began, start.t),
            "stop": stop_source(self._manifest) if job.stop else None,
            "watch": [value.name for value in self._manifest.observation.values] if watch else None,
        }
        # the child must begin the run; a watched run has the arguments of the waiting processes
        if waiting.key is None:
            request["args"] = self._arguments(job, self._running(job).home if watch else home.out)
        limits = {"wall_s": self._limits.wall_s, "disk_mb": self._limits.disk_mb}
        # a sandbox's /tmp is beside the run's folder
        limited = self._runs if self._manifest.sandbox else home.path
        asked = {"do": "mutant", "job": marshal.dumps(request), "home": str(limited), **limits}
        with nullcontext() if waiting.key else used_unchanged(job.scenario):
            said, _ = waiting.ask(asked, self._patience_s)
        self._running(job).clean()
        if said["threads"]:
            raise NotForkable(too_many(said["threads"]), turned_off(said["threads"]))
        if said["touched"]:
            self.close()
            raise NotForkable("it writes into its own tree")
        return Ended(**{name: said[name] for name in Ended.__slots__})

    def _judged(self, job: Job, home: RunHome, ended: Ended, place: Path, watch: bool) -> Execution:
        home.let_in()
        report = home.read_report(threads=list)
        if report is not None:
            self._check(job, report)
        status, detail = judge(self._limits, ended, report)
        if status is not Status.OK and is_full(self._work, report):
            raise disk_full_error(self._work)
        if status is Status.CRASHED:
            raise NotForkable(f"ended as crashed: {detail}")
        return Execution(
            status=status,
            detail=detail,
            out=home.move_output(place),
            probe=report["probe"] if report else None,
            cpu_s=ended.cpu_s,
            wall_s=ended.wall_s,
            active=home.was_active(),
            log=home.log_tail(),
            stopped=bool(report and report.get("stopped")),
            watched={name: report[name] for name in _WATCHED} if watch and report else {},
            mode=RunMode.WARM if self._warm else RunMode.FORK,
        )

    def _check(self, job: Job, report: dict[str, Any]) -> None:
        """Raise NotForkable if the child did not run the mutant's code, or if threads are left."""
        if report["ended"] == "swap refused":
            raise NotForkable(str(report.get("why")))
        if report["outside"]:
            raise NotForkable(f"the target was also imported from {', '.join(report['outside'])}")
        if report["threads"]:
            others = report["threads"]
            raise NotForkable(f"at its end {too_many(others)}", turned_off(others))
        if report["ended"] == "ok" and (problem := job.problem_of(report["probe"])):
            raise NotForkable(problem)

    def _observed(self, job: Job, golden: Path) -> Observed:
        """Return what a probe observes in a job's golden run. The first call runs it."""
        key = _key(job)
        if key not in self._seen:
            try:
                self._seen[key] = self._watch(job, golden)
            except NotForkable as why:
                self._seen[key] = why
        seen = self._seen[key]
        if isinstance(seen, NotForkable):
            raise NotForkable(*seen.args)
        return seen

    def _watch(self, job: Job, golden: Path) -> Observed:
        known = self._work / f"observed-{content_id(_key(job))}"  # shared by a session's workers
        if known.is_file() and (data := self._authentic(known)):
            values, before, libraries = marshal.loads(data)
            return Observed(values=values, before=before, libraries=libraries)
        folder = self._runs / f"watch-{content_id(_key(job))}"
        try:
            swap = self._swap(job, self._null.files, self._null.probe)
            null = replace(job, mutant=None, stop=False)
            self._at(job, 0, swap)  # NotForkable, with the reason, if the run cannot begin
            # Fork before the first step, because a later fork misses earlier observations.
            first = self._running(job).first
            execution = self._become(first, null, folder, swap, _FROM_THE_START, watch=True)
            if execution.status is Status.HARNESS_ERROR:
                raise ForkServerLost(execution.detail)
            if execution.status is not Status.OK:
                raise NotForkable(f"its golden run ended as {execution.status.value}: {execution.detail}")
            for name in self._manifest.outputs:
                if read_bounded(execution.out / name) != read_bounded(golden / name):
                    raise NotForkable(f"its {name} differs when it is driven step by step")
            seen, *others = (execution.watched[name] for name in _WATCHED)
            found = (tuple(map(tuple, seen)), *map(tuple, others))
            if found[0] and found[1][:1] != (0,):
                raise NotForkable("it observes before its first step")
            data = marshal.dumps(found)
            write_atomic(known, self._code(known, data) + data)
            return Observed(values=found[0], before=found[1], libraries=found[2])
        except NotSwappable as why:
            raise NotForkable(f"its observing statement cannot be inserted: {why}") from None
        finally:
            remove_folder(folder)

    def _authentic(self, path: Path) -> bytes:
        """Return what an engine with the same secret wrote to a file; empty for what a mutant wrote."""
        code, data = (content := read_bounded(path))[:_CODE_BYTES], content[_CODE_BYTES:]
        return data if hmac.compare_digest(code, self._code(path, data)) else b""

    def _code(self, path: Path, data: bytes) -> bytes:
        return hmac.digest(self._secret, path.name.encode() + data, "sha256")


_CODE_BYTES = 32
_WATCHED = ("seen", "before", "libraries")
_FROM_THE_START = Start(step=0, observed=0, began=None, t=None)


def _needed(swap: CodeSwap) -> list[str]:
    return [*dict.fromkeys(function.module for function in swap.functions), *swap.imports]


def _key(job: Job) -> _Key:
    return (_resolved(job.scenario), job.seed, job.changes)


@cache
def _resolved(scenario: Path) -> str:
    return str(scenario.resolve())


def _golden(job: Job, golden: Path) -> Execution:
    return Execution(
        status=Status.OK,
        detail="",
        out=golden,
        probe=untriggered_report(job.mutant),
        cpu_s=0.0,
        wall_s=0.0,
        mode=RunMode.GOLDEN,
    )


def make_fork(setting: Setting) -> ForkEngine:
    return _make(setting, warm=False)


def make_warm(setting: Setting) -> ForkEngine:
    return _make(setting, warm=True)


def _make(setting: Setting, *, warm: bool) -> ForkEngine:
    null = build(setting.manifest, setting.models, None, always_trigger())
    return ForkEngine(
        setting.manifest,
        setting.work,
        setting.limits,
        setting.parent,
        null=null,
        warm=warm,
        secret=setting.secret,
    )
