"""Jobs and engines: what is run, its results, and the engine interface."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Protocol

from mutator.faults.fault_models import FaultModels
from mutator.model import Limits, Status
from mutator.mutants.probe import is_probe, report_problem
from mutator.targets.manifest import TargetManifest


class RunMode(StrEnum):
    """How a run was done: in a fresh interpreter, as a fork, or as the golden run itself."""

    REFERENCE = "reference"
    WARM = "warm"
    FORK = "fork"
    GOLDEN = "golden"  # the trigger never held, so nothing was run


FAST = frozenset({RunMode.WARM.value, RunMode.FORK.value, RunMode.GOLDEN.value})  # modes that need a proof


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run of the target. `files` are the changed and new files of its tree (none: pristine)."""

    name: str
    scenario: Path
    seed: int
    changes: tuple[str, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    mutant: str | None = None  # the id that the probe must report; None: a tree without probe
    injections: tuple[str, ...] = ()  # ids that it must report on
    hash_seed: int = 0
    golden: Path | None = None  # output folder of the run without the fault, if known
    observe: bool = False  # keep what the probe observes
    stop: bool = False  # end the run at its first terminal hazard
    golden_ends: bool = False  # whether one is also in its golden run
    watch: bool = False  # like `observe`, and note calls that make a target nondeterministic
    lines: bool = False  # note which lines of the tree run from the first observation on

    def problem_of(self, report: object) -> str:
        """What is wrong with its probe's report; empty if nothing is, or without a probe."""
        return "" if self.mutant is None else report_problem(report, self.mutant, self.injections)


# (file, line, start byte in the line, -1 if unknown) in the tree, innermost first
Stack = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Raised:
    """The exception that ended a run: its type, its text, and where it left the tree.

    `stacks[0]` is its own; the others are those of its causes and of the exceptions in it.
    """

    kind: str
    message: str
    stacks: tuple[Stack, ...]

    @property
    def place(self) -> str:
        """`file:line` of the innermost target line (without the probe); empty if there is none."""
        return next((f"{path}:{line}" for path, line, _ in self.stacks[0] if not is_probe(path)), "")

    @property
    def text(self) -> str:
        """Type, text and place, for people."""
        if self.kind == SystemExit.__name__:
            what = f"exit status {self.message}"
        else:
            what = f"{self.kind}: {self.message}" if self.message else self.kind
        return f"{what} ({self.place})" if self.place else what


@dataclass(frozen=True, kw_only=True)
class Execution:
    """The result of a job. `out` holds the target's trace and record when status is ok.

    * `status`: how the run ended; `outcomes.blame` decides whose fault that is
    * `raised`: the exception that ended it; `active`: whether an injection was active in it
    * `probe`: the probe's report; `log`: the tail of what the run printed
    * `mode`: how the run was done; `why`: why another engine did it; `start`: the step where it left golden
    * `stopped`: a terminal hazard ended it early
    * `modules`: the third-party top-level modules that it imported
    * `watched`, `seen`, `lines` (from 1, by file): notes of the reference engine
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


class Engine(Protocol):
    """Runs jobs and yields each with its result, in any order; `out` is valid until the next one.

    The output folder may be the golden run's if the trigger never holds: do not change it.
    """

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Execution]]: ...

    def close(self) -> None:
        """End what the engine keeps running between jobs."""


@dataclass(frozen=True, kw_only=True)
class Setting:
    """What an engine is made from.

    `base` is a pristine tree made by `prepare_base`, never written to; `work` an existing scratch folder.
    `parent` is the process that must stay this one's parent, or the engine leaves (None: it may go).
    """

    manifest: TargetManifest
    models: FaultModels
    base: Path
    work: Path
    limits: Limits
    parent: int | None = None
