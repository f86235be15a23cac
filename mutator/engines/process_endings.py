"""Prepare the processes that targets run in, and judge how they ended."""

import json
import os
import re
import resource
import signal
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from mutator._common.confined_files import open_below
from mutator._common.files import is_disk_full_error
from mutator.engines.engine_jobs import Job, RaisedException, innermost_position
from mutator.engines.in_target import process_guard
from mutator.errors import MutatorError, UnsafePath
from mutator.limits import Limits
from mutator.model import Status
from mutator.targets.process_environment import FIXED_VARIABLES, INHERITED_VARIABLES

KILLED_DETAIL, EXITED_DETAIL = (
    "killed by ",
    "left with status ",
)  # how details of crashes without an exception begin
GUARD_LOST = "lost"  # no process is left to report the ending
GUARD_PATIENCE_S = 60.0  # time for the guard's report, after a run's wall limit
_GUARD_END_TIMEOUT_S = 10.0  # to kill what the run left behind
_REPORT_FIELD_TYPES = {"ended": str, "disk_full": bool, "outside": list, "probe": object}
_TEXT_LIST_FIELDS = ("outside", "modules", "libraries", "threads")  # lists of texts in a report
_LOG_TAIL_BYTES = 4000  # a run can print without end
_MIN_FREE_BYTES = 4 << 20  # with less free space than this, a failed run is not blamed on the target
_TRIAL_FILE_BYTES = 1 << 20  # the same applies if a file of this size cannot be written
# also sent by systems and users, so never blamed on the target
_OUTSIDE_SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT)


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessEnding:
    """How a run's process ended: exit code (negative for a signal), CPU time and wall time.

    `stopped` is why it was stopped: WALL or DISK of `process_guard`, GUARD_LOST, or "".
    """

    code: int
    cpu_s: float
    wall_s: float
    stopped: str


def check_own_limits_suffice(limits: Limits) -> None:
    """Raise MutatorError if this process's own limits are lower than the campaign's.

    With lower limits, a run that finishes on other machines could be stopped here.
    """
    required = (
        (resource.RLIMIT_AS, "memory_mb", limits.memory_mb << 20, "ulimit -v"),
        (resource.RLIMIT_CPU, "cpu_s", limits.cpu_s + process_guard.HARD_CPU_EXTRA_S, "ulimit -t"),
        (resource.RLIMIT_FSIZE, "disk_mb", limits.disk_mb << 20, "ulimit -f"),
    )
    for number, name, least, command in required:
        soft, hard = resource.getrlimit(number)
        if hard != resource.RLIM_INFINITY and hard < least:
            try:
                resource.setrlimit(number, (soft, least))  # only root can raise a hard limit
            except ValueError:
                raise MutatorError(
                    f"the limit is {hard} here (`{command}`), but runs can use {least} ({name})",
                    expected="a limit at least as high as that of the runs",
                    remedy=f"raise the limit, or lower {name} in the limits of the campaign",
                ) from None


def status_of_ending(
    limits: Limits, ending: ProcessEnding, report: dict[str, Any] | None, job: Job
) -> tuple[Status, str]:
    if stopped := _find_status_if_stopped(limits, ending):
        return stopped
    if report is not None:
        return _status_of_report(limits, report, job)
    if ending.code < 0:
        return Status.CRASHED, f"{KILLED_DETAIL}{signal.Signals(-ending.code).name}"
    return Status.CRASHED, f"{EXITED_DETAIL}{ending.code} without a report"


def _find_status_if_stopped(limits: Limits, ending: ProcessEnding) -> tuple[Status, str] | None:
    """Judge a run that a limit or an outside signal stopped, even after its report."""
    killed = signal.Signals(-ending.code) if ending.code < 0 else None
    if ending.stopped == GUARD_LOST:
        return Status.HARNESS_ERROR, f"the process that guarded the run is gone (exit code {ending.code})"
    if ending.stopped == process_guard.WALL:
        return Status.TIMEOUT, limits.wall_limit_text
    if ending.stopped == process_guard.DISK:
        return Status.TIMEOUT, f"disk limit of {limits.disk_mb} MiB"
    # the kernel sends SIGXCPU at the limit, and SIGKILL soon after to a process that ignores it
    if killed is signal.SIGXCPU or (killed is signal.SIGKILL and ending.cpu_s >= limits.cpu_s):
        return Status.TIMEOUT, limits.cpu_limit_text
    if killed in _OUTSIDE_SIGNALS:
        return Status.HARNESS_ERROR, f"killed from outside by {killed.name}"
    return None


def _status_of_report(limits: Limits, report: dict[str, Any], job: Job) -> tuple[Status, str]:
    if report["ended"] == "steps":
        return Status.TIMEOUT, f"limit of {limits.steps} simulation steps"
    if raised := exception_in_report(report, job):
        return Status.CRASHED, raised.description
    return Status.OK, ""


def exception_in_report(report: dict[str, Any], job: Job | None = None) -> RaisedException | None:
    """Return the exception that ended a run; without a `job`, the run of a pristine tree."""
    error = report["error"]
    if error is None:
        return None
    first_stack, *other_stacks = (
        tuple((str(path), int(line), int(column)) for path, line, column in stack)
        for stack in error["stacks"]
    )
    stacks = (first_stack, *other_stacks)
    place = ""
    if position := innermost_position(first_stack):
        place = job.place_in_target(*position) if job else f"{position[0]}:{position[1]}"
    return RaisedException(kind=str(error["kind"]), message=str(error["message"]), stacks=stacks, place=place)


def environment_variables_of_run(
    hash_seed: int, temporary_folder: Path, extra_variables: Mapping[str, str] | None = None
) -> dict[str, str]:
    """Return the environment of a run. Of the user's variables, it has only those that Python needs."""
    inherited = {name: os.environ[name] for name in INHERITED_VARIABLES if name in os.environ}
    fixed = {**FIXED_VARIABLES, "PYTHONHASHSEED": str(hash_seed), "TMPDIR": str(temporary_folder)}
    return {**inherited, **(extra_variables or {}), **fixed}


def wait_for_guard(guard_process: subprocess.Popen[bytes]) -> None:
    """Wait for a guarding process. It ends when its connection is closed."""
    try:
        guard_process.wait(_GUARD_END_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        guard_process.kill()
        guard_process.wait()


def read_log_tail(folder: Path, name: str) -> str:
    """Return the end of a text file that a run wrote; empty if there is none."""
    try:
        with open_below(folder, name) as file:
            return log_tail(file.fileno(), os.fstat(file.fileno()).st_size)
    except (OSError, UnsafePath):
        return ""


def log_tail(file: int, byte_count: int) -> str:
    """Return the end of the first bytes of an open text file."""
    start = max(0, byte_count - _LOG_TAIL_BYTES)
    return os.pread(file, byte_count - start, start).decode("utf-8", "replace")


def parse_run_report(data: bytes, **extra_fields: type) -> dict[str, Any] | None:
    """Return the child's report; None if it is incomplete or invalid.

    Each field is checked, because a run can write anything to this file. `extra_fields` are those that
    only one engine reports.
    """
    try:
        report: dict[str, Any] = json.loads(data)
        exception_in_report(report)
        is_valid = all(
            isinstance(report[key], kind) for key, kind in (_REPORT_FIELD_TYPES | extra_fields).items()
        )
        is_valid = is_valid and all(
            isinstance(name, str) for key in _TEXT_LIST_FIELDS for name in report.get(key, ())
        )
    except (LookupError, TypeError, ValueError, RecursionError):
        return None
    return report if is_valid else None


def was_disk_full(work_folder: Path, report: dict[str, Any] | None) -> bool:
    """Return whether a failed run lacked space on the disk or in a quota."""
    if report is not None and report["disk_full"]:
        return True
    try:
        state = os.statvfs(work_folder)
    except OSError as err:
        return is_disk_full_error(err)  # a run can delete the folder
    if state.f_bavail * state.f_frsize < _MIN_FREE_BYTES:
        return True
    try:
        with TemporaryFile(dir=work_folder) as trial:
            trial.write(bytes(_TRIAL_FILE_BYTES))
    except OSError as err:
        return is_disk_full_error(err)
    return False


def exception_without_run_specifics(raised: RaisedException, folder: Path) -> RaisedException:
    stacks = tuple(
        tuple((without_run_specifics(path, folder), line, column) for path, line, column in stack)
        for stack in raised.stacks
    )
    return RaisedException(
        kind=without_run_specifics(raised.kind, folder),
        message=without_run_specifics(raised.message, folder),
        stacks=stacks,
        place=without_run_specifics(raised.place, folder),
    )


def without_run_specifics(detail: str, folder: Path) -> str:
    """Remove what differs between runs (scratch paths, addresses); keep the text printable and short."""
    text = detail.replace(str(folder / "tree") + os.sep, "").replace(str(folder), "...")
    # four digits: a shorter number is a value of the target, not an address
    text = re.sub(r"0x[0-9a-fA-F]{4,}", "0x...", text)[:500]
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
