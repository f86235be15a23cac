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
    """How a run was carried out: in a fresh interpreter, as a fork, or as the golden run itself."""

    REFERENCE = "reference"
    WARM = "warm"
    FORK = "fork"
    GOLDEN = "golden"  # the trigger never held, so there was nothing to run


FAST = frozenset({RunMode.WARM.value, RunMode.FORK.value, RunMode.GOLDEN.value})  # what a proof is for


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run of the target. `files` are the changed and new files of its tree (none: pristine)."""

    name: str
    scenario: Path
    seed: int
    changes: tuple[str, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    mutant: str | None = None  # id that the probe must report; None: a tree without probe
    injections: tuple[str, ...] = ()  # ids that it must report on
    hash_seed: int = 0
    golden: Path | None = None  # output folder of the run without the fault, where it is known
    observe: bool = False  # keep what the probe observes
    stop: bool = False  # end it at its first terminal hazard
    golden_ends: bool = False  # one is in its golden run, too
    watch: bool = False  # the same as `observe`, and note calls that keep a target from being deterministic
    lines: bool = False  # note which lines of the tree are executed, from the first observation on

    def problem_of(self, report: object) -> str:
        """What is wrong with what its probe reported; empty if nothing is, or if it has no probe."""
        return "" if self.mutant is None else report_problem(report, self.mutant, self.injections)


# (file, line, byte of the line at which what raised begins, -1 if unknown) in the tree, innermost first
Stack = tuple[tuple[str, int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Raised:
    """The exception that ended a run: its type, its text, and where it passed the tree on its way out.

    `stacks[0]` is its own; the others are those of the exceptions that it came of or that are in it.
    """

    kind: str
    message: str
    stacks: tuple[Stack, ...]

    @property
    def place(self) -> str:
        """`file:line` of the innermost line of the target (the probe is none); empty if there is none."""
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

    The status says how the run ended; whose doing that is, `outcomes.blame` decides. `raised` is the
    exception that ended it, and `active` says whether an injection was active in it. `probe` is the probe's
    report if the tree has one; `log` the tail of what the run printed. `mode` says how it was carried out,
    and `why` another engine did it than the one that was asked; `start` is the step before which the golden
    run did its work. `stopped` says that a terminal hazard ended it before its time. `modules` are the top-
    level modules that the run imported from neither its package nor the standard library, `watched` what a
    watched one noted, and what its probe observed (`seen`), of the reference engine alone; so are `lines`,
    the lines (from 1) of each file that were executed.
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
    """Runs jobs and yields each with what came of it, in any order; `out` is valid until the next one.

    The output folder of a job whose trigger never holds may be the golden run's: it is not to be touched.
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
