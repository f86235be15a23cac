"""Jobs and engines: what to run, the results, and the interface of engines."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import partial
from pathlib import Path
from secrets import token_bytes
from typing import Any, Protocol

from mutator.faults.fault_models import FaultModels
from mutator.model import Limits, Status
from mutator.mutants.probe import Probe, is_probe_path, report_problem
from mutator.targets.manifest import TargetManifest


class RunMode(StrEnum):
    """How a run was executed."""

    REFERENCE = "reference"
    WARM = "warm"
    FORK = "fork"
    GOLDEN = "golden"  # the trigger never held, so no run was needed


# modes that need the equivalence check
FAST = frozenset({RunMode.WARM.value, RunMode.FORK.value, RunMode.GOLDEN.value})


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run of the target. `files` are the changed and new files of its tree; empty if pristine."""

    name: str
    scenario: Path
    seed: int
    changes: tuple[str, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    mutant: str | None = None  # the id that the probe must report; None for a tree without a probe
    probe: Probe | None = None  # the probe in `files`; engines that fork need it
    injections: tuple[str, ...] = ()  # all ids that the probe must report on
    hash_seed: int = 0
    golden: Path | None = None  # output folder of the fault-free run, if known
    observe: bool = False  # keep what the probe observes
    stop: bool = False  # end the run at its first terminal hazard
    golden_ends: bool = False  # whether the golden run has a terminal hazard, too
    watch: bool = False  # like `observe`; also note calls that make a target nondeterministic
    lines: bool = False  # note which lines of the tree run from the first observation on

    def problem_of(self, report: object) -> str:
        """Return the problem with the probe's report; empty if there is none, or no probe."""
        return "" if self.mutant is None else report_problem(report, self.mutant, self.injections)


# frames in the tree, innermost first: file, line, start byte in the line (-1 if unknown)
Stack = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Raised:
    """The exception that ended a run.

    `stacks[0]` is its own stack. The others are those of its causes and of the exceptions that it groups.
    """

    kind: str
    message: str
    stacks: tuple[Stack, ...]

    @property
    def place(self) -> str:
        """`file:line` of the innermost target line outside the probe; empty if there is none."""
        return next((f"{path}:{line}" for path, line, _ in self.stacks[0] if not is_probe_path(path)), "")

    @property
    def text(self) -> str:
        if self.kind == SystemExit.__name__:
            what = f"exit status {self.message}"
        else:
            what = f"{self.kind}: {self.message}" if self.message else self.kind
        return f"{what} ({self.place})" if self.place else what


@dataclass(frozen=True, kw_only=True)
class Execution:
    """The result of a job. `out` holds the target's trace and record if `status` is OK.

    * `status`: how the run ended; `outcomes.blame` decides what caused it
    * `active`: whether an injection was active
    * `log`: the tail of what the run printed
    * `why`: why another engine executed the job; `start`: the step at which the run was forked
    * `stopped`: whether a terminal hazard ended the run early
    * `modules`: the third-party top-level modules that the run imported
    * `watched`, `lines` (from 1, by file): what the reference engine noted
    """

    status: Status
    detail: str
    out: Path
    probe: dict[str, Any] | None
    cpu_s: float
    wall_s: float
    raised: Raised | None = None
    active: bool = False
    log: str = ""
    mode: RunMode = RunMode.REFERENCE
    why: str = ""
    start: int = 0
    stopped: bool = False
    modules: tuple[str, ...] = ()
    watched: Mapping[str, Any] = field(default_factory=dict)
    lines: Mapping[str, list[int]] = field(default_factory=dict)


def failed(why: str, out: Path, mode: RunMode) -> Execution:
    """Return the result of a job that the harness could not run."""
    return Execution(
        status=Status.HARNESS_ERROR, detail=why, out=out, probe=None, cpu_s=0.0, wall_s=0.0, mode=mode
    )


class Engine(Protocol):
    """Runs jobs and yields each with its result, in any order. `out` stays valid until the next result.

    Callers must not change `out`: if the trigger never holds, it is the golden run's.
    """

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Execution]]: ...

    def close(self) -> None:
        """End the processes that the engine keeps between jobs."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """The arguments of an engine's factory.

    `work` is an existing scratch folder. If `parent` is a process id, the engine exits once that process is
    no longer its parent. Engines with the same `secret` share files in `work`.
    """

    manifest: TargetManifest
    models: FaultModels
    work: Path
    limits: Limits
    parent: int | None = None
    secret: bytes = field(default_factory=partial(token_bytes, 16))
