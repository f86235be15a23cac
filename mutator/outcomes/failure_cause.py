"""Decides whether the target, the fault or the harness made a mutant's run fail.

If an injected line is on the stack of the exception or of its cause, the injection is the origin, even if a
function that the line called raised the exception. A failure before the fault was first active is blamed on
the harness, because the fault-free run finishes normally.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import dropwhile

from mutator.engines.engine_jobs import JobResult, RaisedException, TargetStack
from mutator.model import RunError, Status
from mutator.mutants.injected_line_syntax import Tag, changed_value_positions, place_in_target, tag_of
from mutator.mutants.probe_contract import is_probe_path

_CodePosition = tuple[str, int, int]  # file, line, column


@dataclass(frozen=True, slots=True, kw_only=True)
class _ExceptionCause:
    """The cause of an exception: an injected line or, if `tag` is None, the probe."""

    place: str = ""
    tag: Tag | None = None
    injection_ids: Sequence[str] = ()


class _ChangedFiles:
    """The changed files of a mutant, with the injection and the target's own line at each position."""

    def __init__(self, files: Mapping[str, bytes], ids_before_anchor: Collection[str]) -> None:
        self._files = files
        self._ids_before_anchor = ids_before_anchor
        self._lines = {path: data.splitlines() for path, data in files.items()}

    def tag_at(self, position: _CodePosition) -> Tag | None:
        file, line = self._lines.get(position[0], ()), position[1]
        return tag_of(file[line - 1]) if 0 < line <= len(file) else None

    def place_in_target(self, position: _CodePosition) -> str:
        return place_in_target(*position[:2], self._files, self._ids_before_anchor)

    def injection_ids_at(self, position: _CodePosition, tag: Tag, in_probe: bool) -> Sequence[str]:
        """Return the ids of the injections whose code is at this position. There can be none, because a
        changed line also has unchanged parts.
        """
        if tag.replaced_line is None:
            return tag.ids if tag.is_of_fault and not (in_probe and tag.is_guard) else ()
        file, line, column = position
        parts = changed_value_positions(self._files[file])
        return [name for name, part_line, begin, end in parts if part_line == line and begin <= column < end]


def judge_failure(
    job_result: JobResult,
    changed_files: Mapping[str, bytes],
    raising_injection_ids: Collection[str],
    ids_before_anchor: Collection[str] = (),
) -> tuple[Status, str]:
    """Return the status and detail of a mutant's run. `changed_files` and `ids_before_anchor` are those of
    the mutant.

    `raising_injection_ids` has the ids of injections whose fault models raise exceptions on purpose.
    """
    status, detail, raised = job_result.status, job_result.detail, job_result.exception
    if status not in (Status.CRASHED, Status.TIMEOUT):
        return status, detail
    files = _ChangedFiles(changed_files, ids_before_anchor)
    cause = _exception_cause(raised, files) if raised else None
    if (cause and not cause.tag) or (raised and job_result.probe_report is None):
        return Status.HARNESS_ERROR, f"the probe failed: {detail}"
    if not job_result.was_fault_active:
        return Status.HARNESS_ERROR, f"{detail}, before the fault was active"
    if cause and cause.tag and not any(name in raising_injection_ids for name in cause.injection_ids):
        code = cause.tag.line_without_tag.decode("utf-8", "replace").strip()
        return Status.INVALID_MUTANT, f"{cause.place}: the injected `{code}` ended the run: {detail}"
    return status, detail


def run_error(raised: RaisedException | None) -> RunError | None:
    return RunError(kind=raised.kind, message=raised.message, place=raised.place) if raised else None


def _exception_cause(raised: RaisedException, files: _ChangedFiles) -> _ExceptionCause | None:
    innermost, *others = raised.stacks
    if raised.kind == RecursionError.__name__:  # any call can be the one that exceeds the limit
        innermost = tuple(
            dropwhile(lambda at: is_probe_path(at[0]) or files.tag_at(at) is not None, innermost)
        )
    causes = [cause for stack in (innermost, *others) if (cause := _cause_on_stack(stack, files))]
    return min(causes, key=lambda source: source.tag is not None, default=None)  # prefer the probe


def _cause_on_stack(stack: TargetStack, files: _ChangedFiles) -> _ExceptionCause | None:
    """Return the innermost injected line or probe call on the stack; None if it has neither.

    If a helper function of the probe fails on a value, the line that called it is the cause. If the probe
    fails while it decides whether the fault is active, the probe is the cause. If a changed line calls the
    target's own code, exceptions there belong to the target.
    """
    in_probe = in_target = False
    for position in stack:
        tag = files.tag_at(position)
        if is_probe_path(position[0]):
            in_probe = True
        elif tag and tag.replaced_line is not None and in_target:
            continue
        elif tag and (ids := files.injection_ids_at(position, tag, in_probe)):
            return _ExceptionCause(place=files.place_in_target(position), tag=tag, injection_ids=ids)
        elif in_probe or (tag and tag.replaced_line is None):
            return _ExceptionCause()
        in_target = in_target or (tag is None and not is_probe_path(position[0]))
    return _ExceptionCause() if in_probe else None
