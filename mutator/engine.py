"""Engines run jobs: a tree, a scenario, a seed. The reference engine: a fresh interpreter for each."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from mutator.model import Status


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


@dataclass(frozen=True, kw_only=True)
class Execution:
    """What came of a job. `out` holds the target's trace and record when status is ok.

    `probe` is the probe's report if the tree has one; `log` the tail of what the run printed.
    """

    status: Status
    detail: str
    out: Path
    probe: dict[str, Any] | None
    cpu_s: float
    wall_s: float
    log: str = ""


class Engine(Protocol):
    """Runs jobs and yields each with what came of it, in any order; `out` is valid until the next one."""

    def run(self, jobs: Iterable[Job]) -> Iterator[tuple[Job, Execution]]: ...
