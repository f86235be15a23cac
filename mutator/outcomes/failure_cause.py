"""Decides whether the target, the fault or the harness made a mutant's run fail.

If an injected line is on the stack of the exception or of its cause, the injection is the origin, even if a
function that the line called raised the exception. A failure before the fault was first active is blamed on
the harness, because the fault-free run finishes normally.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import dropwhile

from mutator.engines.engine_jobs import Execution, Raised, Stack
from mutator.model import RunError, Status
from mutator.mutants.injected_lines import Tag, changed_value_positions, tag_of
from mutator.mutants.probe import is_probe_path

_At = tuple[str, int, int]  # file, line, column


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    """The cause of an exception: an injected line or, if `tag` is None, the probe."""

    place: str
    tag: Tag | None = None
    ids: Sequence[str] = ()


class _Files:
    """The changed files of a mutant, with the injection at each position."""

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self._files = files
        self._lines = {path: data.splitlines() for path, data in files.items()}

    def tag_at(self, at: _At) -> Tag | None:
        file, line = self._lines.get(at[0], ()), at[1]
        return tag_of(file[line - 1]) if 0 < line <= len(file) else None

    def injected_at(self, at: _At, tag: Tag, in_probe: bool) -> Sequence[str]:
        """Return the ids of the injections whose code is at this position. There can be none, because a
        changed line also has unchanged parts.
        """
        if tag.replaced_line is None:
            return tag.ids if tag.is_of_fault and not (in_probe and tag.is_guard) else ()
        file, line, column = at
        parts = changed_value_positions(self._files[file])
        return [name for name, there, begin, end in parts if there == line and begin <= column < end]


def assign_blame(
    execution: Execution, files: Mapping[str, bytes], raising: Collection[str]
) -> tuple[Status, str]:
    """Return the status and detail of a mutant's run. `files` are the mutant's changed files.

    `raising` has the ids of injections whose fault models raise exceptions on purpose.
    """
    status, detail, raised = execution.status, execution.detail, execution.raised
    if status not in (Status.CRASHED, Status.TIMEOUT):
        return status, detail
    source = _source(raised, _Files(files)) if raised else None
    if (source and not source.tag) or (raised and execution.probe is None):
        return Status.HARNESS_ERROR, f"the probe failed: {detail}"
    if not execution.active:
        return Status.HARNESS_ERROR, f"{detail}, before the fault was active"
    if source and source.tag and not any(name in raising for name in source.ids):
        code = source.tag.code.decode("utf-8", "replace").strip()
        return Status.INVALID_MUTANT, f"{source.place}: the injected `{code}` ended the run: {detail}"
    return status, detail


def error_of(raised: Raised | None) -> RunError | None:
    return RunError(kind=raised.kind, message=raised.message, place=raised.place) if raised else None


def _source(raised: Raised, files: _Files) -> _Source | None:
    own, *others = raised.stacks
    if raised.kind == RecursionError.__name__:  # any call can be the one that exceeds the limit
        own = tuple(dropwhile(lambda at: is_probe_path(at[0]) or files.tag_at(at) is not None, own))
    found = [source for stack in (own, *others) if (source := _on_stack(stack, files))]
    return min(found, key=lambda source: source.tag is not None, default=None)  # prefer the probe


def _on_stack(stack: Stack, files: _Files) -> _Source | None:
    """Return the innermost injected line or probe call on the stack; None if it has neither.

    If a helper function of the probe fails on a value, the line that called it is the cause. If the probe
    fails while it decides whether the fault is active, the probe is the cause. If a changed line calls the
    target's own code, exceptions there belong to the target.
    """
    in_probe = in_target = False
    for at in stack:
        place, tag = f"{at[0]}:{at[1]}", files.tag_at(at)
        if is_probe_path(at[0]):
            in_probe = True
        elif tag and tag.replaced_line is not None and in_target:
            continue
        elif tag and (ids := files.injected_at(at, tag, in_probe)):
            return _Source(place=place, tag=tag, ids=ids)
        elif in_probe or (tag and tag.replaced_line is None):
            return _Source(place=place)
        in_target = in_target or (tag is None and not is_probe_path(at[0]))
    return _Source(place="") if in_probe else None
