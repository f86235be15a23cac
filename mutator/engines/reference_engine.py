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
from mutator._common.file_change_detection import FileChangeDetector
from mutator._common.files import disk_full_error, raising_disk_full, remove_anything_at, remove_folder
from mutator._common.hashing import digest
from mutator.engines.engine_jobs import (
    EngineArguments,
    Job,
    JobResult,
    RunMode,
    harness_error_result,
)
from mutator.engines.executed_functions import executed_functions_from_json
from mutator.engines.job_folder import (
    PLAIN_OUTPUT_FOLDER,
    ReportingJobFolder,
    can_be_disturbance,
    ensure_work_folder,
)
from mutator.engines.job_tree_pool import JobTreePool
from mutator.engines.process_endings import (
    GUARD_LOST,
    GUARD_PATIENCE_S,
    ProcessEnding,
    check_own_limits_suffice,
    environment_variables_of_run,
    exception_in_report,
    exception_without_run_specifics,
    status_of_ending,
    wait_for_guard,
    was_disk_full,
    without_run_specifics,
)
from mutator.engines.sandbox import Sandbox
from mutator.limits import Limits
from mutator.model import Status
from mutator.mutants.defence_runtime import defence_report_request
from mutator.mutants.parsed_files_and_anchors import parsed_file
from mutator.mutants.probe_contract import probe_attributes_after, probe_module
from mutator.targets.manifest import TargetManifest

_CHILD_SCRIPT = Path(__file__).parent / "in_target" / "run_once.py"
_PARENT_CHECK_INTERVAL_S = 0.5  # interval between two checks that the parent is alive
_MOST_GUARD_REPORT_BYTES = 4096  # maximum size of the guard's report, in bytes


class ReferenceEngine:
    """Runs each job in a fresh interpreter on its own tree.

    The parameters are those of `EngineArguments`. If the manifest supports it, runs of an `independent`
    engine use no data left by other runs. The same holds for mutants that change a file in the manifest's
    `reads_itself`.
    """

    def __init__(
        self,
        manifest: TargetManifest,
        work_folder: Path,
        limits: Limits,
        parent_pid: int | None = None,
        *,
        independent: bool = False,
    ) -> None:
        check_own_limits_suffice(limits)
        self.manifest = manifest
        self.work_folder = work_folder.resolve()
        self._tree_pool = JobTreePool(manifest.tree, self.work_folder, manifest.entry_module)
        self.limits = limits
        self._pristine_digests = {path: digest(data) for path, data in manifest.tree.files.items()}
        self._parent_pid = parent_pid
        self._is_independent = independent

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, JobResult]]:
        for job in jobs:
            folder = self.folder_of_job(job)
            try:
                yield job, self.execute(job, folder)
            finally:
                remove_folder(folder)

    def folder_of_job(self, job: Job) -> Path:
        """Return the scratch folder in which `run` runs a job. In a sandbox, no other run reaches it."""
        return self.work_folder / f"{os.getpid()}-{job.name}"

    def close(self) -> None:
        self._tree_pool.close()

    def execute(self, job: Job, folder: Path) -> JobResult:
        """Run one job in the new scratch folder `folder`, which the caller deletes.

        It runs again, once, if it or another run changed what it uses.
        """
        with raising_disk_full(self.work_folder):
            try:
                execution, was_disturbed = self._try_once(job, folder)
            except OSError as err:
                if not can_be_disturbance(err):
                    raise
                was_disturbed = True
            if was_disturbed:
                remove_anything_at(folder)
                try:
                    execution, _ = self._try_once(job, folder, fresh_tree=True)
                except OSError as err:
                    if not can_be_disturbance(err):
                        raise
                    why = f"the folder of the run was changed while it was in use ({err.strerror})"
                    return harness_error_result(why, folder, RunMode.REFERENCE)
        return execution

    def _try_once(self, job: Job, folder: Path, *, fresh_tree: bool = False) -> tuple[JobResult, bool]:
        """Run a job; return the result, and whether its input or folders were changed meanwhile.

        With `fresh_tree`, the job gets a tree of its own, without bytecode.
        """
        ensure_work_folder(self.work_folder)
        with ReportingJobFolder(folder) as home:
            ended, changed_input = self._run_in_folder(job, home, fresh_tree=fresh_tree)
            was_moved = home.was_moved()
            return self._result_of_run(job, home, ended, changed_input), bool(changed_input) or was_moved

    def _run_in_folder(
        self, job: Job, home: ReportingJobFolder, *, fresh_tree: bool
    ) -> tuple[ProcessEnding, str]:
        """Run a job; return how it ended, and a file of its input that was changed meanwhile (or nothing)."""
        folder = home.path
        tree = self._tree_pool.lay_out_tree(folder / "tree", job.changed_files, fresh=fresh_tree)
        request = json.dumps(self._job_request(job, home)).encode()
        path = folder / "job.json"
        path.write_bytes(request)
        scenario = job.scenario.resolve()
        inputs = FileChangeDetector({str(path): request, str(scenario): read_bounded(scenario)})
        ended = self._run_guarded(job, path, home)
        changed_input = tree.first_changed_path() or inputs.first_changed_path().removeprefix(f"{folder}/")
        if not (changed_input or fresh_tree):
            self._tree_pool.take_back_tree(tree)
        return ended, changed_input

    def _result_of_run(
        self, job: Job, home: ReportingJobFolder, ended: ProcessEnding, changed_input: str
    ) -> JobResult:
        home.unlock()
        report = home.read_report(files=dict, modules=list)
        status, detail = self._status_of_run(job, ended, report, changed_input)
        if status is not Status.OK and was_disk_full(self.work_folder, report):
            raise disk_full_error(self.work_folder)
        raised = exception_in_report(report, job) if report and status is Status.CRASHED else None
        return JobResult(
            status=status,
            detail=without_run_specifics(detail, home.path),
            out=home.move_plain_output(home.path / PLAIN_OUTPUT_FOLDER),
            probe_report=report["probe"] if report else None,
            cpu_s=ended.cpu_s,
            wall_s=ended.wall_s,
            exception=raised and exception_without_run_specifics(raised, home.path),
            was_fault_active=home.was_fault_active(),
            log_tail=home.log_tail(),
            was_stopped=bool(report and report.get("stopped")),
            third_party_modules=tuple(report["modules"]) if report else (),
            executed_functions=executed_functions_from_json(report.get("executed")) if report else None,
            watch_report=report.get("watched", {}) if report else {},
            executed_lines=report.get("lines", {}) if report else {},
            variable_types=report.get("types", {}) if report else {},
            reach_report=report.get("reach", {}) if report else {},
        )

    def _job_request(self, job: Job, home: ReportingJobFolder) -> dict[str, Any]:
        arguments = self.manifest.run_arguments(
            scenario=job.scenario.resolve(),
            seed=job.seed,
            out=home.output_folder,
            changes=job.scenario_changes,
            independent=self._is_independent or self.manifest.run_reads_any(job.changed_files),
        )
        return {
            "home": str(home.path),
            "tree": str(home.path / "tree"),
            "packages": list(self.manifest.import_names),
            "module": self.manifest.entry_module,
            "args": list(arguments),
            "probe": probe_module(self.manifest.probe_package) if job.mutant_id is not None else None,
            "out": str(home.output_folder),
            "defences": defence_report_request(self.manifest),
            "report": str(home.report_path),
            "inactive": str(home.inactive_marker),
            "child_activations": str(home.child_activations_path),
            "watched_places": job.watched_places,
            "cpu_s": self.limits.cpu_s,
            "wall_s": self.limits.wall_s,
            "memory_mb": self.limits.memory_mb,
            "disk_mb": self.limits.disk_mb,
            "steps": self.limits.steps,
            "stop": job.stop_source(self.manifest),
            "stepwise": self.manifest.stepwise_function,
            "step_by_step": job.drive_step_by_step,
            "functions": job.note_executed_functions,
            "watch": job.watch_nondeterminism,
            "observe": self._observed_names() if job.watch_nondeterminism or job.keep_observations else None,
            "lines": self._observation_lines() if job.note_executed_lines else None,
            "types": self._observation_lines() if job.note_variable_types else None,
        }

    def _observation_lines(self) -> tuple[str, list[int]]:
        location = self.manifest.observation.location
        first, last = parsed_file(self.manifest.tree, location.path).line_span(location)
        return location.path, [line + 1 for line in range(first, max(last, first + 1))]

    def _observed_names(self) -> tuple[str, list[str]]:
        holder, _ = probe_attributes_after(0, None, None)
        return holder, [value.name for value in self.manifest.observation.values]

    def _run_guarded(self, job: Job, request_path: Path, home: ReportingJobFolder) -> ProcessEnding:
        """Run the job in a guarded process. Process and guard end when the connection is closed."""
        began, folder = time.monotonic(), home.path
        harness_socket, guard_socket = socket.socketpair()
        command = [
            sys.executable,
            "-P",
            "-s",
            str(_CHILD_SCRIPT),
            str(request_path),
            str(guard_socket.fileno()),
        ]
        scenario, fault_free = job.scenario.resolve(), not job.changed_files
        sandbox = Sandbox.of_target(self.manifest, folder, [scenario], fault_free=fault_free)
        if sandbox:
            command = sandbox.wrap_command(command)
        with harness_socket:
            with guard_socket, home.log_path.open("wb") as log:
                guard_process = subprocess.Popen(
                    command,
                    cwd=folder,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    env=environment_variables_of_run(job.hash_seed, folder, self.manifest.env),
                    pass_fds=[guard_socket.fileno()],
                    start_new_session=True,  # Ctrl-C at the terminal is for the command, not for the target
                )
            try:
                guard_report = self._receive_guard_report(
                    harness_socket, guard_process, began + self.limits.wall_s + GUARD_PATIENCE_S
                )
            finally:
                harness_socket.close()
                wait_for_guard(guard_process)
                if sandbox:
                    sandbox.delete_new_temporary_paths()
                    sandbox.close()
        if not guard_report:
            seconds = time.monotonic() - began
            return ProcessEnding(code=guard_process.returncode, cpu_s=0.0, wall_s=seconds, stopped=GUARD_LOST)
        return ProcessEnding(**json.loads(guard_report))

    def _receive_guard_report(
        self, connection: socket.socket, guard_process: subprocess.Popen[bytes], deadline: float
    ) -> bytes:
        """Return the guard's report; empty if none arrives in time. Exit if this process's parent is gone."""
        connection.settimeout(_PARENT_CHECK_INTERVAL_S)
        while time.monotonic() < deadline:
            try:  # the guard sends its report in one write
                return connection.recv(_MOST_GUARD_REPORT_BYTES)
            except TimeoutError:
                guard_process.send_signal(signal.SIGCONT)  # a run can stop its guard
                if self._parent_pid is not None and os.getppid() != self._parent_pid:
                    raise SystemExit("the process that started this one is gone") from None
        return b""

    def _status_of_run(
        self, job: Job, ended: ProcessEnding, report: dict[str, Any] | None, changed_input: str
    ) -> tuple[Status, str]:
        if report is not None and (problem := self._problem_with_tree(job, report, changed_input)):
            return Status.HARNESS_ERROR, problem
        status, detail = status_of_ending(self.limits, ended, report, job)
        if (
            report is None and changed_input and status is Status.CRASHED
        ):  # whoever changed it can have caused this
            return Status.HARNESS_ERROR, _describe_changed_input(changed_input)
        if report is None or (status is not Status.OK and report["probe"] is None):
            return status, detail
        problem = job.problem_of_probe_report(report["probe"])
        return (Status.HARNESS_ERROR, problem) if problem else (status, detail)

    def _problem_with_tree(self, job: Job, report: dict[str, Any], changed_input: str) -> str:
        """Return the problem with the tree that ran; empty if it was the job's."""
        if report["outside"]:
            return f"the target was also imported from {', '.join(report['outside'])}"
        expected = self._pristine_digests | {path: digest(data) for path, data in job.changed_files.items()}
        # a data cache can leave other files in the tree
        more = {path for path in report["files"] if path.endswith(".py")}
        for path in sorted(expected.keys() | more):
            if report["files"].get(path) != expected.get(path):
                return f"{path} in the tree that ran is not the one of this job"
        return _describe_changed_input(changed_input) if changed_input else ""


def _describe_changed_input(changed_input: str) -> str:
    return f"{changed_input} was changed while it was in use"


def make_reference_engine(arguments: EngineArguments) -> ReferenceEngine:
    return ReferenceEngine(arguments.manifest, arguments.work_folder, arguments.limits, arguments.parent_pid)
