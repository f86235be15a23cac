"""Jobs and engines: what is run, its results, and the engine interface."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any, Protocol

from mutator.faults.fault_models import FaultModels
from mutator.model import Limits, Status
from mutator.targets.manifest import TargetManifest


class RunMode(StrEnum):
    """How a run was carried out: in a fresh interpreter, as a fork, or as the golden run itself."""

    REFERENCE = "reference"
    WARM = "warm"
    FORK = "fork"
    GOLDEN = "golden"  # the trigger never held, so there was nothing to run


@dataclass(frozen=True, kw_only=True)
class Job:
    """One run of the target. `files` are the changed and new files of its tree (none: pristine)."""

    name: str
    scenario: Path
    seed: int
    changes: tuple[str, ...] = ()
    files: Mapping[str, bytes] = field(default_factory=dict)
    mutant: str | None = None  # id that the probe must report; None: a tree without probe
    hash_seed: int = 0
    golden: Path | None = None  # output folder of the run without the fault, where it is known


@dataclass(frozen=True, kw_only=True)
class Execution:
    """The result of a job. `out` holds the target's trace and record when status is ok.

    `probe` is the probe's report if the tree has one; `log` the tail of what the run printed. `mode`
    says how it was carried out, and `why` another engine did it than the one that was asked; `start` is the
    step before which the golden run did its work. `modules` are the top-level modules that the run imported
    from neither its package nor the standard library (of the reference engine alone).
    """

    status: Status
    detail: str
    out: Path
    probe: dict[str, Any] | None
    cpu_s: float
    wall_s: float
    log: str = ""
    mode: RunMode = RunMode.REFERENCE
    why: str = ""
    start: int = 0
    modules: tuple[str, ...] = ()


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
