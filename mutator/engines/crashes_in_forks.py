"""Judges crashes of forks without a second run, if the reference engine has confirmed others of their kind.

A forked run leaves a crash to the reference engine unless all of this holds:

* the process reported the exception and ended by itself; no limit, signal or thread is involved;
* a step of the run raised it while the fault had been active (not its end, which writes the results);
* it and its causes are of classes that do not depend on the process (`in_target/crash_description.py`), and
  do not name a folder of the run, which differs;
* in this session, the reference engine has rerun three crashes of the same classes, one of them with the same
  message at the same place, and each time got the same. If it gets another result once, no crash of these
  classes is judged here.

The last point covers what only a fresh interpreter has: an entry module that catches some exceptions of its
steps, and messages that tell something about the process, such as a name of its main module. Such a message
is the same in both processes, or the rerun of the first crash with it shows that it is not.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutator._common.hashing import content_id
from mutator.engines.authenticated_files import AuthenticatedFiles
from mutator.engines.engine_jobs import CrashKind, Job, JobResult, RaisedException, TargetStack
from mutator.engines.process_endings import ProcessEnding, exception_in_report
from mutator.engines.received_fork_output import ReceivedForkOutput
from mutator.mutants.injected_line_syntax import mutated_line_of
from mutator.mutants.probe_contract import is_probe_path

NEEDED_CONFIRMATIONS = 3  # crashes with the same classes that the reference engine runs, too
_SAME, _OTHER = "same", "other"  # what the reference engine gave
_MOST_FRAMES = 10_000


class CrashKinds:
    """The crashes that the reference engine has confirmed, for all workers of a session."""

    def __init__(self, files: AuthenticatedFiles) -> None:
        self._files = files
        self._confirmed: set[CrashKind] = set()

    def is_confirmed(self, kind: CrashKind) -> bool:
        if self._has(kind.classes_id, _OTHER):
            return False
        if kind not in self._confirmed:
            if not self._has(kind.place_id, _SAME) or self._same_count(kind) < NEEDED_CONFIRMATIONS:
                return False
            self._confirmed.add(kind)
        return True

    def note(self, kind: CrashKind, *, is_same: bool) -> None:
        """Note what the reference engine gave for a crash. Once it gave another result, that stays."""
        if not is_same:
            self._save(kind.classes_id, _OTHER)
            return
        self._save(kind.place_id, _SAME)
        if (count := self._same_count(kind)) < NEEDED_CONFIRMATIONS:
            self._save(kind.classes_id, f"{_SAME}-{count}")

    def _same_count(self, kind: CrashKind) -> int:
        return sum(self._has(kind.classes_id, f"{_SAME}-{number}") for number in range(NEEDED_CONFIRMATIONS))

    def _has(self, crash_id: str, answer: str) -> bool:
        return self._files.load(_file_name(crash_id, answer)) is not None

    def _save(self, crash_id: str, answer: str) -> None:
        self._files.save(_file_name(crash_id, answer), b"1")


def _file_name(crash_id: str, answer: str) -> str:
    return f"crash-{crash_id}-{answer}"


@dataclass(frozen=True, slots=True)
class CrashOfFork:
    kind: CrashKind
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
        classes = crash["classes"]
        kind = CrashKind(
            classes_id=content_id([classes]), place_id=content_id([classes, raised.message, raised.place])
        )
    except (LookupError, TypeError, ValueError):  # a run can write anything to its report
        return None
    return CrashOfFork(kind, raised)


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
