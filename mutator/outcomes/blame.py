"""Whose doing it is that a run of a mutant did not end well: the target's, the fault's, or the harness's.

An exception is blamed on what it came out of. If an injected line is on its way, or on that of an exception
that it came of, it came out of what was injected, whatever that line had called. And whatever happened before
the fault was first active is not the fault's doing: the run without the fault ends well.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import dropwhile

from mutator.engines.jobs import Execution, Raised, Stack
from mutator.model import RunError, Status
from mutator.mutants.probe import Tag, is_probe, tag_of

_Lines = Mapping[str, Sequence[bytes]]  # of the changed files


@dataclass(frozen=True, slots=True, kw_only=True)
class _Source:
    """What an exception came out of that is not the target's: an injected line, or (no tag) the probe."""

    place: str
    tag: Tag | None = None


def assign_blame(
    execution: Execution, files: Mapping[str, bytes], raising: Collection[str]
) -> tuple[Status, str]:
    """Status and detail of a run that did not end well, of a mutant with these changed files.

    `raising` are the ids of the injections whose fault models declare that they raise.
    """
    status, detail, raised = execution.status, execution.detail, execution.raised
    if status not in (Status.CRASHED, Status.TIMEOUT):
        return status, detail
    source = _source(raised, {path: data.splitlines() for path, data in files.items()}) if raised else None
    if (source and not source.tag) or (raised and execution.probe is None):
        return Status.HARNESS_ERROR, f"the probe failed: {detail}"
    if not execution.active:
        return Status.HARNESS_ERROR, f"{detail}, before the fault was active"
    if source and source.tag and not any(name in raising for name in source.tag.ids):
        code = source.tag.code.decode("utf-8", "replace").strip()
        return Status.INVALID_MUTANT, f"{source.place}: the injected `{code}` ended the run: {detail}"
    return status, detail


def error_of(raised: Raised | None) -> RunError | None:
    """The exception as records keep it."""
    return RunError(kind=raised.kind, message=raised.message, place=raised.place) if raised else None


def _source(raised: Raised, lines: _Lines) -> _Source | None:
    """What the exception came out of; None: the target's own code."""
    own, *others = raised.stacks
    if raised.kind == RecursionError.__name__:  # which call is one too many is chance
        own = tuple(dropwhile(lambda at: is_probe(at[0]) or _tag_at(at, lines) is not None, own))
    found = [source for stack in (own, *others) if (source := _on_stack(stack, lines))]
    return min(found, key=lambda source: source.tag is not None, default=None)  # the probe goes first


def _on_stack(stack: Stack, lines: _Lines) -> _Source | None:
    """The innermost line of it that is not the target's. What a helper of the probe cannot do with a value is
    put down to the line that called it, and whether the fault is active to the probe."""
    in_probe = False
    for at in stack:
        place, tag = f"{at[0]}:{at[1]}", _tag_at(at, lines)
        if is_probe(at[0]):
            in_probe = True
        elif tag and _is_injected(tag, at[2], in_probe):
            return _Source(place=place, tag=tag)
        elif in_probe or (tag and tag.was is None):
            return _Source(place=place)
    return _Source(place="") if in_probe else None


def _is_injected(tag: Tag, column: int, in_probe: bool) -> bool:
    """Whether what an injection has the line do is what raised there. A changed line does what it did,
    too."""
    if tag.was is None:
        return tag.of_fault and not (in_probe and tag.asks_probe)
    return any(first <= column < end for first, end in tag.changed_parts)


def _tag_at(at: tuple[str, int, int], lines: _Lines) -> Tag | None:
    """The tag of that line, if it was injected."""
    file, line = lines.get(at[0], ()), at[1]
    return tag_of(file[line - 1]) if 0 < line <= len(file) else None
