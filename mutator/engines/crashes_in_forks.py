"""Judges crashes of forks without a second run, if the reference engine has confirmed others of their kind.

A forked run leaves a crash to the reference engine unless all of this holds:

* the process reported the exception and ended by itself; no limit, signal or thread is involved;
* a step of the run raised it while the fault had been active (not its end, which writes the results);
* it and its causes are of classes that do not depend on the process (`in_target/crash_description.py`), and
  do not name a folder of the run, which differs;
* the reference engine has rerun three crashes of the same classes, with the same message and at the same
  place, in this session, and each time found the same. If it finds another one, no such crash is judged here.

The last point covers what only a fresh interpreter has: an entry module that catches some exceptions of its
steps, and messages that tell something about the process, such as a name of its main module.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.hashing import content_id
from mutator.engines.authenticated_files import AuthenticatedFiles
from mutator.engines.engine_jobs import Job, JobResult, RaisedException, TargetStack
from mutator.engines.process_endings import ProcessEnding, exception_in_report
from mutator.engines.received_fork_output import ReceivedForkOutput
from mutator.mutants.injected_line_syntax import mutated_line_of
from mutator.mutants.probe_contract import is_probe_path

NEEDED_CONFIRMATIONS = 3  # crashes of a kind that the reference engine runs, too
_SAME, _OTHER = "same", "other"  # what the reference engine gave
_MOST_FRAMES = 10_000


class CrashKinds:
    """The kinds of crashes that the reference engine has confirmed, for all workers of a session. Those of a
    kind have the same classes, message and place.
    """

    def __init__(self, files: AuthenticatedFiles) -> None:
        self._files = files
        self._confirmed: set[str] = set()

    def is_confirmed(self, crash_kind: str) -> bool:
        if crash_kind not in self._confirmed:
            if self._has(crash_kind, _OTHER) or self._same_count(crash_kind) < NEEDED_CONFIRMATIONS:
                return False
            self._confirmed.add(crash_kind)
        return True

    def note(self, crash_kind: str, *, is_same: bool) -> None:
        """Note what the reference engine gave for a crash. Once it gave another result, that stays."""
        if not is_same:
            self._confirmed.discard(crash_kind)
            self._files.save(_file_name(crash_kind, _OTHER), b"1")
        elif (count := self._same_count(crash_kind)) < NEEDED_CONFIRMATIONS:
            self._files.save(_file_name(crash_kind, f"{_SAME}-{count}"), b"1")

    def _same_count(self, crash_kind: str) -> int:
        return sum(self._has(crash_kind, f"{_SAME}-{number}") for number in range(NEEDED_CONFIRMATIONS))

    def _has(self, crash_kind: str, answer: str) -> bool:
        return self._files.load(_file_name(crash_kind, answer)) is not None


def _file_name(crash_kind: str, answer: str) -> str:
    return f"crash-{crash_kind}-{answer}"


@dataclass(frozen=True, slots=True)
class CrashOfFork:
    """An exception, and an id of its classes and those of its causes, its message and its place."""

    kind_id: str
    exception: RaisedException


def judge_crash(
    job: Job,
    report: dict[str, Any] | None,
    ended: ProcessEnding,
    output: ReceivedForkOutput,
    work_folder: Path,
) -> CrashOfFork | None:
    """Return what a fork raised; None if only the reference engine can judge it."""
    crash = report and report.get("crash")
    if not report or not isinstance(crash, dict) or ended.code or ended.stopped or report["threads"]:
        return None
    if not output.was_fault_active or job.problem_of_probe_report(report["probe"]):
        return None
    if str(work_folder) in str((report["error"], crash)):
        return None
    try:
        stacks = [_stack_of_mutant(job, frames) for frames in crash["frames"]]
        raised = exception_in_report({"error": {**report["error"], "stacks": stacks}}, job)
        if raised is None:
            return None
        kind_id = content_id([crash["classes"], raised.message, raised.place])
    except (LookupError, TypeError, ValueError):  # a run can write anything to its report
        return None
    return CrashOfFork(kind_id, raised)


def _stack_of_mutant(job: Job, frames: list[list[Any]]) -> TargetStack:
    position_by_line: dict[tuple[str, int], tuple[str, int, int]] = {}
    for file, line, column, is_new in frames[:_MOST_FRAMES]:
        path, number = str(file), int(line)
        if path in job.changed_files and not is_new and not is_probe_path(path):
            number = mutated_line_of(job.changed_files[path], number)
        position_by_line.setdefault((path, number), (path, number, int(column)))
    return tuple(position_by_line.values())


def is_same_crash(of_fork: JobResult, of_reference: JobResult) -> bool:
    """Return whether the reference engine ended a run as a fork did, with the same exception."""
    raised, reference = of_fork.exception, of_reference.exception
    has_same_ending = _ending_of(of_fork) == _ending_of(of_reference)
    return has_same_ending and bool(raised and reference and _is_same_exception(raised, reference))


def _ending_of(result: JobResult) -> tuple[object, ...]:
    return result.status, result.detail, result.probe_report, result.was_fault_active


def _is_same_exception(raised: RaisedException, reference: RaisedException) -> bool:
    """Return whether two exceptions are the same, but for the frames outside of the steps."""
    return (
        (raised.kind, raised.message, raised.place) == (reference.kind, reference.message, reference.place)
        and len(raised.stacks) == len(reference.stacks)
        and all(
            whole[: len(inner)] == inner for inner, whole in zip(raised.stacks, reference.stacks, strict=True)
        )
    )
