"""A run folder for notebooks: its results as a pandas frame; its traces, patches and faults when asked."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from mutator.errors import MutatorError
from mutator.execution.traces import Traces
from mutator.model import Experiment, Fault
from mutator.outcomes.golden import Trace, load_trace
from mutator.outcomes.reader import Results
from mutator.store import plan_file as planfile
from mutator.store.run_folder import RunFolder, golden_key
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace


def load_run(path: str | Path, *, root: str | Path | None = None) -> "Run":
    """The run folder at `path`.

    `root` holds fault_library/ and templates/, which traces need; default: as on the command line, the
    environment's or the nearest folder upward. MutatorError when `path` is no run folder.
    """
    return Run(RunFolder.open(Path(path)), Path(root) if root is not None else None)


@dataclass(frozen=True, repr=False)
class Run:
    """A run folder, read when asked. Experiments are named by their id, or by the start of just one."""

    folder: RunFolder
    root: Path | None = None
    _shown: dict[str, pd.DataFrame] = field(default_factory=dict, repr=False, compare=False)

    def __repr__(self) -> str:
        head = self.folder.head
        done = f"{len(self.frame)} of {self.folder.planned} experiments"
        return f"<Run {self.folder.path.name}: {done} of {head['campaign']}, {head['reading']}>"

    @property
    def path(self) -> Path:
        """The folder."""
        return self.folder.path

    @property
    def provenance(self) -> dict[str, Any]:
        """Campaign, target, seed, reading and choices; digests of the sources; versions."""
        head = self.folder.head
        keys = ("campaign", "target", "plan", "choices", "limits")
        return {key: head[key] for key in keys} | self.folder.provenance

    @cached_property
    def faults(self) -> dict[str, Fault]:
        """The planned faults by id: value, aim, and what is injected where."""
        return planfile.read_faults(self.path)

    @cached_property
    def experiments(self) -> dict[str, Experiment]:
        """The planned experiments by id, in the plan's order."""
        return {e.id: e for e in planfile.read_all(self.path)}

    @cached_property
    def frame(self) -> pd.DataFrame:
        """A row per experiment that has a record, by experiment id: the columns of results.csv, typed.

        As `mutator.outcomes.reader.Results.frame` makes it; the table is brought up to date first.
        """
        return Results.up_to_date(self.path).frame()

    def golden(self, scenario: str, changes: tuple[str, ...] | None = None) -> pd.DataFrame:
        """The fault-free run of a scenario: a column per channel, by time in s.

        `changes` of the scenario tell apart what was driven in several ways, `("no_lead",)`; default: those
        of most experiments. MutatorError for one that was not driven.
        """
        driven = [e.changes for e in self.experiments.values() if e.scenario == scenario]
        if changes is None and driven:
            changes = max(dict.fromkeys(driven), key=driven.count)
        folder = self.folder.golden(scenario, changes or ())
        if not folder.is_dir():
            known = sorted(path.name for path in (self.path / "golden").glob("*"))
            raise MutatorError(
                f"no golden run {golden_key(scenario, changes or ())}",
                where=self.path,
                expected=f"one of {', '.join(known) or 'none'}",
            )
        return self._once(folder.name, lambda: load_trace(self._traces.manifest, folder))

    def trace(self, experiment: str) -> pd.DataFrame:
        """The faulty run of an experiment: a column per channel, by time in s.

        Where no trace was kept, which is usual, it is driven again, to the same bytes, and kept. MutatorError
        when the target is no longer the one that was run, or another trace comes out.
        """
        name = self.folder.find(experiment)
        return self._once(name, lambda: self._traces.of(name)[1])

    def patch(self, experiment: str) -> str:
        """The source diff of an experiment that ran."""
        path = self.folder.patch(self.folder.find(experiment))
        if not path.is_file():
            raise MutatorError(
                f"no patch of {experiment}", where=path, remedy="it has not run, or its mutant was refused"
            )
        return path.read_bytes().decode("utf-8", "surrogateescape")

    @cached_property
    def _traces(self) -> Traces:
        return Traces(self._workspace, self.folder)

    @cached_property
    def _workspace(self) -> Workspace:
        return Workspace.find(self.root)

    def _once(self, name: str, read: Callable[[], Trace]) -> pd.DataFrame:
        if name not in self._shown:
            self._shown[name] = _frame(read(), self._traces.manifest)
        return self._shown[name]


def _frame(trace: Trace, manifest: TargetManifest) -> pd.DataFrame:
    """A trace by time in s; `attrs["units"]` has the units of the channels that the manifest tells."""
    frame = pd.DataFrame(dict(trace)).set_index(manifest.time_channel)
    frame.attrs["units"] = {c.name: c.unit for c in (*manifest.compared, *manifest.plotted)}
    return frame
