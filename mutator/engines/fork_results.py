"""From what a fork left to the result of its job."""

from pathlib import Path
from typing import Any

from mutator._common.files import disk_full_error
from mutator.engines.crashes_in_forks import judge_crash
from mutator.engines.engine_jobs import Job, JobResult, RunMode
from mutator.engines.executed_functions import ExecutedFunctions, executed_functions_from_json
from mutator.engines.fork_messages import check_fork_report
from mutator.engines.job_folder import JobFolder
from mutator.engines.observation_store import OBSERVATION_KEYS
from mutator.engines.process_endings import (
    ProcessEnding,
    exception_in_report,
    exception_without_run_specifics,
    status_of_ending,
    was_disk_full,
    without_run_specifics,
)
from mutator.engines.received_fork_output import ReceivedForkOutput
from mutator.errors import NotForkable
from mutator.limits import Limits
from mutator.model import Status
from mutator.mutants.probe_contract import untriggered_report


class ForkResults:
    """Makes results of forks that run in folders of `work_folder`."""

    def __init__(self, limits: Limits, work_folder: Path, mode: RunMode) -> None:
        self._limits = limits
        self._work_folder = work_folder
        self._mode = mode

    def result_of(
        self,
        job: Job,
        home: JobFolder,
        ended: ProcessEnding,
        output: ReceivedForkOutput,
        output_destination: Path,
        *,
        observe: bool,
    ) -> JobResult:
        """Return the result; NotForkable if only the reference engine can tell it. With `observe`, the run
        was a golden one.
        """
        home.unlock()
        if home.was_moved():
            raise NotForkable("it moves its folder")
        if output.is_log_full:
            raise NotForkable("it prints much")
        report = output.read_report(threads=list, modules=list)
        if report is not None:
            check_fork_report(job, report, is_golden=observe)
        status, detail = status_of_ending(self._limits, ended, report, job)
        if status is not Status.OK and was_disk_full(self._work_folder, report):
            raise disk_full_error(self._work_folder)
        crash = (
            judge_crash(job, report, ended, output, self._work_folder) if status is Status.CRASHED else None
        )
        if status is Status.CRASHED and not crash:
            raise NotForkable(_describe_crash(report, detail))
        return JobResult(
            status=status,
            detail=without_run_specifics(crash.exception.description, home.path) if crash else detail,
            exception=exception_without_run_specifics(crash.exception, home.path) if crash else None,
            out=home.move_plain_output(output_destination),
            probe_report=report["probe"] if report else None,
            cpu_s=ended.cpu_s,
            wall_s=ended.wall_s,
            was_fault_active=output.was_fault_active,
            log_tail=output.log_tail(),
            was_stopped=bool(report and report.get("stopped")),
            third_party_modules=tuple(report["modules"]) if report else (),
            executed_functions=executed_functions_from_json(report.get("executed")) if report else None,
            watch_report={name: report[name] for name in OBSERVATION_KEYS} if observe and report else {},
            mode=self._mode,
            crash_kind=crash.kind if crash else None,
        )


def _describe_crash(report: dict[str, Any] | None, detail: str) -> str:
    raised = exception_in_report(report) if report else None
    return f"ended as crashed: {raised.description_without_place if raised else detail}"


def golden_result_of_inactive_fault(
    job: Job, golden: Path, executed_functions: ExecutedFunctions | None
) -> JobResult:
    """Return the result of a fault that is never active: that of the golden run, without a run."""
    return JobResult(
        status=Status.OK,
        detail="",
        out=golden,
        probe_report=untriggered_report(job.mutant_id),
        executed_functions=executed_functions,
        cpu_s=0.0,
        wall_s=0.0,
        mode=RunMode.GOLDEN_REUSED,
    )
