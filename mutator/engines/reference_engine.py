"""The reference engine: each job runs in a fresh interpreter on its own tree."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.file_change_detection import UnchangedFiles
from mutator._common.files import disk_full_error, raising_disk_full, remove_anything_at, remove_folder
from mutator._common.hashing import digest
from mutator.engines.engine_jobs import Execution, Job, Raised, RunMode, Setting, failed
from mutator.engines.job_folder import OUTPUT, RunHome, is_disturbance, make_work
from mutator.engines.job_tree_pool import BaseTree
from mutator.engines.sandbox import Sandbox
from mutator.engines.target_processes import (
    LOST,
    PATIENCE_S,
    Ended,
    check_limits,
    end,
    environment,
    is_full,
    judge,
    raised_in,
    steady,
)
from mutator.model import Limits, Status
from mutator.mutants.anchors import parsed_file
from mutator.mutants.probe import probe_module, probe_state_after
from mutator.targets.manifest import TargetManifest
from mutator.targets.stop_code import stop_source

_CHILD = Path(__file__).parent / "in_target" / "run_once.py"
_LOOK_UP_S = 0.5  # interval between two checks that the parent is alive
_LONGEST = 4096  # maximum size of the guard's report, in bytes


class ReferenceEngine:
    """Runs each job in a fresh interpreter on its own tree.

    The parameters are those of `Setting`. If the manifest supports it, runs of an `independent` engine use no
    data left by other runs. The same holds for mutants that change a file in the manifest's `reads_itself`.
    """

    def __init__(
        self,
        manifest: TargetManifest,
        work: Path,
        limits: Limits,
        parent: int | None = None,
        *,
        independent: bool = False,
    ) -> None:
        check_limits(limits)
        self.manifest = manifest
        self.work = work.resolve()
        self._base_tree = BaseTree(manifest.tree, self.work)
        self.limits = limits
        self._pristine = {path: digest(data) for path, data in manifest.tree.files.items()}
        self._parent = parent
        self._independent = independent

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Execution]]:
        for job in jobs:
            folder = self.folder_of(job)
            try:
                yield job, self.execute(job, folder)
            finally:
                remove_folder(folder)

    def folder_of(self, job: Job) -> Path:
        """Return the scratch folder in which `run` runs a job. In a sandbox, no other run reaches it."""
        return self.work / f"{os.getpid()}-{job.name}"

    def close(self) -> None:
        self._base_tree.close()

    def execute(self, job: Job, folder: Path) -> Execution:
        """Run one job in the new scratch folder `folder`, which the caller deletes.

        It runs again, once, if it or another run changed what it uses.
        """
        with raising_disk_full(self.work):
            try:
                execution, disturbed = self._try(job, folder)
            except OSError as err:
                if not is_disturbance(err):
                    raise
                disturbed = True
            if disturbed:
                remove_anything_at(folder)
                try:
                    execution, _ = self._try(job, folder, new=True)
                except OSError as err:
                    if not is_disturbance(err):
                        raise
                    why = f"the folder of the run was changed while it was in use ({err.strerror})"
                    return failed(why, folder, RunMode.REFERENCE)
        return execution

    def _try(self, job: Job, folder: Path, *, new: bool = False) -> tuple[Execution, bool]:
        """Run a job; return the result, and whether its input or folders were changed meanwhile.

        With `new`, the job gets a tree of its own, without bytecode.
        """
        make_work(self.work)
        with RunHome(folder) as home:
            ended, changed = self._run(job, home, new=new)
            moved = home.is_moved()
            return self._execution(job, home, ended, changed), bool(changed) or moved

    def _run(self, job: Job, home: RunHome, *, new: bool) -> tuple[Ended, str]:
        """Run a job; return how it ended, and a file of its input that was changed meanwhile (or nothing)."""
        folder = home.path
        tree = self._base_tree.lay_out(folder / "tree", job.files, new=new)
        request = json.dumps(self._request(job, home)).encode()
        path = folder / "job.json"
        path.write_bytes(request)
        scenario = job.scenario.resolve()
        inputs = UnchangedFiles({str(path): request, str(scenario): read_bounded(scenario)})
        ended = self._guarded(job, path, home)
        changed = tree.first_changed() or inputs.first_changed().removeprefix(f"{folder}/")
        if not (changed or new):
            self._base_tree.take_back(tree)
        return ended, changed

    def _execution(self, job: Job, home: RunHome, ended: Ended, changed: str) -> Execution:
        home.let_in()
        report = home.read_report(files=dict, modules=list)
        status, detail = self._judge(job, ended, report, changed)
        if status is not Status.OK and is_full(self.work, report):
            raise disk_full_error(self.work)
        raised = raised_in(report) if report and status is Status.CRASHED else None
        return Execution(
            status=status,
            detail=steady(detail, home.path),
            out=home.move_output(home.path / OUTPUT),
            probe=report["probe"] if report else None,
            cpu_s=ended.cpu_s,
            wall_s=ended.wall_s,
            raised=raised and _steady(raised, home.path),
            active=home.was_active(),
            log=home.log_tail(),
            stopped=bool(report and report.get("stopped")),
            modules=tuple(report["modules"]) if report else (),
            watched=report.get("watched", {}) if report else {},
            lines=report.get("lines", {}) if report else {},
        )

    def _request(self, job: Job, home: RunHome) -> dict[str, Any]:
        arguments = self.manifest.arguments(
            scenario=job.scenario.resolve(),
            seed=job.seed,
            out=home.out,
            changes=job.changes,
            independent=self._independent or self.manifest.reads_any(job.files),
        )
        return {
            "home": str(home.path),
            "tree": str(home.path / "tree"),
            "packages": list(self.manifest.import_names),
            "module": self.manifest.entry_module,
            "args": list(arguments),
            "probe": probe_module(self.manifest.package) if job.mutant is not None else None,
            "out": str(home.out),
            "report": str(home.report),
            "inactive": str(home.inactive),
            "cpu_s": self.limits.cpu_s,
            "wall_s": self.limits.wall_s,
            "memory_mb": self.limits.memory_mb,
            "disk_mb": self.limits.disk_mb,
            "steps": self.limits.steps,
            "stop": stop_source(self.manifest) if job.stop else None,
            "stepwise": self.manifest.stepwise,
            "watch": job.watch,
            "observe": self._observed() if job.watch or job.observe else None,
            "lines": self._observation() if job.lines else None,
        }

    def _observation(self) -> tuple[str, list[int]]:
        location = self.manifest.observation.location
        first, last = parsed_file(self.manifest.tree, location.path).line_span(location)
        return location.path, [line + 1 for line in range(first, max(last, first + 1))]

    def _observed(self) -> tuple[str, list[str]]:
        holder, _ = probe_state_after(0, None, None)
        return holder, [value.name for value in self.manifest.observation.values]

    def _guarded(self, job: Job, request: Path, home: RunHome) -> Ended:
        """Run the job in a guarded process. Process and guard end when the connection is closed."""
        began, folder = time.monotonic(), home.path
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-s", str(_CHILD), str(request), str(theirs.fileno())]
        scenario, fault_free = job.scenario.resolve(), not job.files
        sandbox = Sandbox.of(self.manifest, folder, [scenario], fault_free=fault_free)
        if sandbox:
            command = sandbox.command(command)
        with ours:
            with theirs, home.log.open("wb") as log:
                guarding = subprocess.Popen(
                    command,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=environment(job.hash_seed, folder, self.manifest.env),
                    pass_fds=[theirs.fileno()],
                    start_new_session=True,  # Ctrl-C at the terminal is for the command, not for the target
                )
            try:
                told = self._told(ours, guarding, began + self.limits.wall_s + PATIENCE_S)
            finally:
                ours.close()
                end(guarding)
                if sandbox:
                    sandbox.clear()
                    sandbox.close()
        if not told:
            seconds = time.monotonic() - began
            return Ended(code=guarding.returncode, cpu_s=0.0, wall_s=seconds, stopped=LOST)
        return Ended(**json.loads(told))

    def _told(self, connection: socket.socket, guarding: subprocess.Popen[bytes], deadline: float) -> bytes:
        """Return the guard's report; empty if none arrives in time. Exit if this process's parent is gone."""
        connection.settimeout(_LOOK_UP_S)
        while time.monotonic() < deadline:
            try:
                return connection.recv(_LONGEST)
            except TimeoutError:
                guarding.send_signal(signal.SIGCONT)  # a run can stop its guard
                if self._parent is not None and os.getppid() != self._parent:
                    raise SystemExit("the process that started this one is gone") from None
        return b""

    def _judge(
        self, job: Job, ended: Ended, report: dict[str, Any] | None, changed: str
    ) -> tuple[Status, str]:
        if report is not None and (problem := self._wrong_tree(job, report, changed)):
            return Status.HARNESS_ERROR, problem
        status, detail = judge(self.limits, ended, report)
        if report is None and changed and status is Status.CRASHED:  # whoever changed it can have caused this
            return Status.HARNESS_ERROR, _in_use(changed)
        if report is None or (status is not Status.OK and report["probe"] is None):
            return status, detail
        problem = job.problem_of(report["probe"])
        return (Status.HARNESS_ERROR, problem) if problem else (status, detail)

    def _wrong_tree(self, job: Job, report: dict[str, Any], changed: str) -> str:
        """Return the problem with the tree that ran; empty if it was the job's."""
        if report["outside"]:
            return f"the target was also imported from {', '.join(report['outside'])}"
        expected = self._pristine | {path: digest(data) for path, data in job.files.items()}
        # a data cache can leave other files in the tree
        more = {path for path in report["files"] if path.endswith(".py")}
        for path in sorted(expected.keys() | more):
            if report["files"].get(path) != expected.get(path):
                return f"{path} in the tree that ran is not the one of this job"
        return _in_use(changed) if changed else ""


def _in_use(changed: str) -> str:
    return f"{changed} was changed while it was in use"


def _steady(raised: Raised, folder: Path) -> Raised:
    stacks = tuple(
        tuple((steady(path, folder), line, column) for path, line, column in stack) for stack in raised.stacks
    )
    return Raised(kind=steady(raised.kind, folder), message=steady(raised.message, folder), stacks=stacks)


def make_reference(setting: Setting) -> ReferenceEngine:
    return ReferenceEngine(setting.manifest, setting.work, setting.limits, setting.parent)
