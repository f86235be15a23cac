"""Says why a statement executes never, too early or in another process, from a run that watched it."""

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.message_text import counted
from mutator.engines.engine_jobs import Job, JobResult
from mutator.model import FaultLocation
from mutator.targets.manifest import TargetManifest

UNTRIGGERED_REASON = "the trigger never held"
_MOST_START_LINES = 3  # lines that a text names
_GRAPH_HINT = "as for code that is built or traced once (casadi, JAX, torch.compile)"


class Reach(StrEnum):
    """Where a statement executes."""

    IN_RUN = "in the run"
    BEFORE_RUN = "before the first observation"
    IN_CHILD = "in a child process"
    REPLACED = "replaced"
    NOT_IMPORTED = "not imported"
    NEVER = "never"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceReach:
    """Where the statement of a location executes, with a text that completes `it ...` or names the file."""

    reach: Reach
    text: str


def reach_of_place(
    manifest: TargetManifest, job: Job, result: JobResult, injection_id: str, location: FaultLocation
) -> PlaceReach:
    """Return where the statement executes, according to a job of `reach_jobs.watched_job`."""
    report = _ReachReport(result.reach_report)
    entry = ((result.probe_report or {}).get("injections") or {}).get(injection_id) or {}
    if count := entry.get("count", 0):
        return PlaceReach(reach=Reach.IN_RUN, text=_describe_times(count, entry["first"], entry["last"]))
    if injection_id in report.children:
        return PlaceReach(reach=Reach.IN_CHILD, text=_describe_child(job, report.starts))
    if count := report.counts_before.get(injection_id, 0):
        times = "once" if count == 1 else f"{count} times"
        text = f"it runs only before the first observation ({times}), {_GRAPH_HINT}"
        return PlaceReach(reach=Reach.BEFORE_RUN, text=text)
    alias = _alias_hint(manifest, location.path, report.loaded)
    if report.loaded and location.path not in report.loaded:
        return PlaceReach(reach=Reach.NOT_IMPORTED, text=f"{location.path} is never imported{alias}")
    if replacement := report.replacements.get(f"{location.path}::{location.function}"):
        text = f"{location.function} of {location.path} is replaced by {_with_target_line(job, replacement)}"
        return PlaceReach(reach=Reach.REPLACED, text=text)
    return PlaceReach(reach=Reach.NEVER, text=f"it is never executed{alias}")


class _ReachReport:
    """The report of the watching process. Damaged parts count as empty, as a target can write it, too."""

    def __init__(self, report: Mapping[str, Any]) -> None:
        self.counts_before: Mapping[str, int] = _value_of_type_or_empty(report.get("before"), dict)
        self.children: Sequence[str] = _value_of_type_or_empty(report.get("children"), list)
        self.starts: Sequence[tuple[str, int, int]] = _value_of_type_or_empty(report.get("starts"), list)
        self.loaded: Sequence[str] = _value_of_type_or_empty(report.get("loaded"), list)
        self.replacements: Mapping[str, str] = _value_of_type_or_empty(report.get("replaced"), dict)


def _value_of_type_or_empty(value: object, kind: type) -> Any:
    return value if isinstance(value, kind) else kind()


def _describe_times(count: int, first: float, last: float) -> str:
    if count == 1:
        return f"it runs once, at {first:g} s, but not while the trigger holds"
    return (
        f"it runs {counted(count, 'time')}, from {first:g} s to {last:g} s, but never while the trigger holds"
    )


def _describe_child(job: Job, starts: Sequence[tuple[str, int, int]]) -> str:
    most = sorted(starts, key=lambda start: -start[2])[:_MOST_START_LINES]
    places = [
        f"{'once' if count == 1 else f'{count} times'} at {job.place_in_target(path, line)}"
        for path, line, count in most
    ]
    started = f" (started {' and '.join(places)})" if places else ""
    return f"it runs only in a child process{started}, in which the trigger never holds"


def _with_target_line(job: Job, replacement: str) -> str:
    name, _, place = replacement.rpartition(" (")
    path, _, line = place.removesuffix(")").rpartition(":")
    return f"{name} ({job.place_in_target(path, int(line))})" if name and line.isdigit() else replacement


def _alias_hint(manifest: TargetManifest, path: str, loaded: Sequence[str]) -> str:
    """Return a hint at another name of the same file, under which the run imports it; empty without one."""
    for other in _same_files(manifest, path):
        if other in loaded:
            real = {os.path.realpath(path_below(manifest.tree.root, name)) for name in (path, other)}
            what = "the same file" if len(real) == 1 else "a copy of it"
            return f"; {other}, {what}, is imported: name that file"
    return ""


def _same_files(manifest: TargetManifest, path: str) -> Iterator[str]:
    files, name = manifest.tree.files, path.rpartition("/")[2]
    for other, data in files.items():
        if other != path and other.rpartition("/")[2] == name and data == files[path] and data.strip():
            yield other
