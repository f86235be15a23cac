"""Jobs and engines: what to run, the results, and the interface of engines."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from secrets import token_bytes
from typing import Any, Protocol

from mutator.engines.executed_functions import ExecutedFunctions
from mutator.faults.fault_models import FaultModels
from mutator.limits import Limits
from mutator.model import Status
from mutator.mutants.injected_line_syntax import place_in_target
from mutator.mutants.probe_contract import ProbeSource, is_probe_path, report_problem
from mutator.targets.early_stop_code import stop_function_source
from mutator.targets.manifest import TargetManifest

MOST_WAITING_PROCESSES = 8  # of golden runs, in a fork server


class RunMode(StrEnum):
    """How a run was executed."""

    REFERENCE = "reference"
    WARM = "warm"
    FORK = "fork"
    GOLDEN_REUSED = "golden"  # the trigger never held, so no run was needed
    REUSED = "reused"  # an earlier run had the same inputs, so its result was copied
    UNAFFECTED = "unaffected"  # nothing that an earlier run executed has changed, so its result was copied


# modes that need the equivalence check
MODES_TO_PROVE = frozenset(mode.value for mode in RunMode if mode is not RunMode.REFERENCE)


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenEnd:
    """Where a terminal hazard, or a set time, ends a golden run: how many rows of its trace come before, and
    how many it has in all.
    """

    rows_before: int
    row_count: int

    def is_after_step(self, step: int, step_count: int) -> bool:
        """Whether the run has not ended before `step`, of `step_count`. No, if the rows of the trace are not
        those of the steps, of which a row before the first step is none.
        """
        return self.row_count in (step_count, step_count + 1) and step < self.rows_before


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run of the target. `changed_files` are the changed and new files of its tree; empty if pristine."""

    name: str
    scenario: Path
    seed: int
    scenario_changes: tuple[str, ...] = ()
    changed_files: Mapping[str, bytes] = field(default_factory=dict)
    mutant_id: str | None = None  # the id that the probe must report; None for a tree without a probe
    probe_source: ProbeSource | None = None  # the probe in `changed_files`; engines that fork need it
    injection_ids: tuple[str, ...] = ()  # all ids that the probe must report on
    ids_before_anchor: Collection[str] = ()  # those whose lines stand above the statement of their anchor
    hash_seed: int = 0
    golden_folder: Path | None = None  # output folder of the fault-free run, if known
    keep_observations: bool = False  # keep what the probe observes
    # drive by the manifest's stepwise function, as forks do, and report what a fork of it must know
    drive_step_by_step: bool = False
    stop_at_hazard: bool = False  # end the run at its first terminal hazard
    end_s: float | None = None  # end a run that may stop at a hazard also at this time
    golden_end: GoldenEnd | None = None  # where a terminal hazard or `end_s` ends the golden run, too
    # like `keep_observations`; also note calls that make a target nondeterministic
    watch_nondeterminism: bool = False
    note_executed_lines: bool = False  # note which lines of the tree run from the first observation on
    note_variable_types: bool = False  # note the types of variables when these lines begin
    # note where the injections' statements execute: file and function of each (`reach_jobs.watched_job`)
    watched_places: tuple[tuple[str, str], ...] = ()
    note_executed_functions: bool = False  # note which functions of the tree run, where Python can tell

    def stop_source(self, manifest: TargetManifest) -> str | None:
        """Return the code that says after each step whether the run ends; None if only its scenario does."""
        return stop_function_source(manifest, self.end_s) if self.stop_at_hazard else None

    def problem_of_probe_report(self, report: object) -> str:
        """Return the problem with the probe's report; empty if there is none, or no probe."""
        return "" if self.mutant_id is None else report_problem(report, self.mutant_id, self.injection_ids)

    def place_in_target(self, path: str, line: int) -> str:
        """Return `file:line` in the target's own tree of a line of the tree that runs."""
        return place_in_target(path, line, self.changed_files, self.ids_before_anchor)


# frames in the tree, innermost first: file, line, start byte in the line (-1 if unknown)
TargetStack = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RaisedException:
    """The exception that ended a run.

    `stacks[0]` is its own stack. The others are those of its causes and of the exceptions that it groups.
    `place` is `file:line`, in the target's own tree, of the innermost line outside the probe; empty if there
    is none.
    """

    kind: str
    message: str
    stacks: tuple[TargetStack, ...]
    place: str = ""

    @property
    def description_without_place(self) -> str:
        if self.kind == SystemExit.__name__:
            return f"exit status {self.message}"
        return f"{self.kind}: {self.message}" if self.message else self.kind

    @property
    def description(self) -> str:
        what = self.description_without_place
        return f"{what} ({self.place})" if self.place else what


def innermost_position(stack: TargetStack) -> tuple[str, int] | None:
    """Return file and line of the innermost position outside the probe; None if there is none."""
    return next(((path, line) for path, line, _ in stack if not is_probe_path(path)), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class CrashKind:
    """An id of the classes of an exception and its causes, and one of classes, message and place."""

    classes_id: str
    place_id: str


@dataclass(frozen=True, kw_only=True)
class JobResult:
    """The result of a job. `out` holds the target's trace and record if `status` is OK.

    * `status`: how the run ended; `outcomes.failure_cause` decides what caused it
    * `was_fault_active`: whether an injection was active
    * `log_tail`: the tail of what the run printed
    * `fallback_reason`: why another engine executed the job
    * `crash_kind`: the kind of a crash that was judged from its fork
    * `fork_step`: the step before which the run was forked
    * `was_stopped`: whether a terminal hazard, or its `end_s`, ended the run before its scenario
    * `third_party_modules`: the third-party top-level modules that the run imported
    * `executed_functions`: what the run executed of the tree; None if that was not noted
    * `watch_report`, `executed_lines` (from 1, by file), `reach_report`, `variable_types` (by file, line and
      name): what the reference engine noted
    """

    status: Status
    detail: str
    out: Path
    probe_report: dict[str, Any] | None
    cpu_s: float
    wall_s: float
    exception: RaisedException | None = None
    was_fault_active: bool = False
    log_tail: str = ""
    mode: RunMode = RunMode.REFERENCE
    fallback_reason: str = ""
    crash_kind: CrashKind | None = None
    fork_step: int = 0
    was_stopped: bool = False
    third_party_modules: tuple[str, ...] = ()
    executed_functions: ExecutedFunctions | None = None
    watch_report: Mapping[str, Any] = field(default_factory=dict)
    executed_lines: Mapping[str, list[int]] = field(default_factory=dict)
    reach_report: Mapping[str, Any] = field(default_factory=dict)
    variable_types: Mapping[str, Mapping[str, Mapping[str, str]]] = field(default_factory=dict)


def harness_error_result(reason: str, out: Path, mode: RunMode) -> JobResult:
    """Return the result of a job that the harness could not run."""
    return JobResult(
        status=Status.HARNESS_ERROR,
        detail=reason,
        out=out,
        probe_report=None,
        cpu_s=0.0,
        wall_s=0.0,
        mode=mode,
    )


class Engine(Protocol):
    """Runs jobs and yields each with its result, in any order. `out` stays valid until the next result.

    Callers must not change `out`: if the trigger never holds, it is the golden run's.
    """

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, JobResult]]: ...

    def close(self) -> None:
        """End the processes that the engine keeps between jobs."""


@dataclass(frozen=True, kw_only=True)
class EngineArguments:
    """The arguments of an engine's factory.

    `work_folder` is an existing scratch folder. Unless `parent_pid` is None, the engine exits once that
    process is no longer its parent. Engines with the same `secret` share files in `work_folder`. An engine
    that forks keeps at most `most_waiting_processes`, some 6 MB each: golden runs that wait at their steps.
    """

    manifest: TargetManifest
    models: FaultModels
    work_folder: Path
    limits: Limits
    parent_pid: int | None = None
    secret: bytes = field(default_factory=partial(token_bytes, 16))
    most_waiting_processes: int = MOST_WAITING_PROCESSES
