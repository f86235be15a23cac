"""The target manifest: all that the harness knows of a controller tree."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from mutator.model import FaultLocation

if TYPE_CHECKING:
    from mutator.sources import SourceTree


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """A recorded channel: its unit for axis labels, and by how much it may differ from golden (0: exact)."""

    name: str
    unit: str
    tolerance: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """Where ground truth is observed, and the target's expressions for it.

    `expressions` gives, for each of t, d_rel, v_ego, v_lead, a dotted name valid at the location.
    """

    location: FaultLocation
    expressions: tuple[tuple[str, str], ...]


@dataclass(frozen=True, kw_only=True)
class TargetManifest:
    """A target: its tree, how to run it, what it records. `root` is absolute.

    An instance is a snapshot: `tree` is read once, so one manifest object never mixes two states of the
    target's sources. Load the manifest again to see an edit.
    """

    name: str
    path: Path  # the manifest file
    root: Path  # absolute source root: goes on sys.path
    package: str  # the import package in it; the probe becomes <package>/_fi.py
    files: tuple[str, ...]  # globs, relative to root: what makes up the tree
    forbid: tuple[str, ...]  # globs: no fault may be injected there
    entry_module: str  # run as `python -m`
    entry_args: tuple[str, ...]  # with {scenario}, {seed}, {out}
    changes: Mapping[str, tuple[str, ...]]  # scenario change -> extra arguments
    step_s: float
    trace_file: str  # an .npz in {out}
    time_channel: str
    compared: tuple[Channel, ...]  # actuator outputs: differing from golden means manifested
    plotted: tuple[Channel, ...]  # others worth a plot
    record_file: str  # a JSON in {out}
    observation: Observation
    hazards: tuple[str, ...]
    alerts: tuple[str, ...]  # alerts that count in experiments
    lines: Mapping[str, int] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def tree(self) -> "SourceTree":
        """The target's files, read once."""
        raise NotImplementedError

    @property
    def probe_path(self) -> str:
        """Path of the probe in a mutated tree, relative to its root."""
        return f"{self.package}/_fi.py"

    def arguments(
        self, *, scenario: Path, seed: int, out: Path, changes: tuple[str, ...] = ()
    ) -> tuple[str, ...]:
        """The entry module's arguments for one run; MutatorError for a change the target does not know."""
        raise NotImplementedError


def load_manifest(path: Path, root: Path | None = None) -> TargetManifest:
    """Read `fault_library/targets/<name>.yaml`; `root` overrides the one it names."""
    raise NotImplementedError
