"""The contents of a run folder, each part read on first use."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mutator.api.selection import Bench
from mutator.campaigns.plans import Plan, load_plan
from mutator.errors import MutatorError
from mutator.execution.traces import Traces
from mutator.model import Experiment, Fault, Record, Status
from mutator.outcomes.fault_paths import FaultPaths, fault_paths_of
from mutator.results import counting
from mutator.results.table_reader import Results
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd


def from_here(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


@dataclass(frozen=True, eq=False, repr=False)
class RunContents:
    """A run folder and its workspace."""

    folder: RunFolder  #: reads the files of the run folder
    given_workspace: Workspace | None = None  #: the workspace that was passed; None: found when needed

    @property
    def path(self) -> Path:
        """The folder."""
        return self.folder.path

    @cached_property
    def workspace(self) -> Workspace:
        """The library, templates and target of the run."""
        return self.given_workspace or Workspace.find()

    @cached_property
    def bench(self) -> Bench:
        """The run's target in the workspace."""
        return Bench.of(self.workspace, self.folder.head["target"])

    @property
    def provenance(self) -> dict[str, Any]:
        """Campaign, target, seed, reading and choices; digests of the sources; under `stretches`, the
        versions and machine of each stretch of work.
        """
        head = self.folder.head
        keys = ("campaign", "target", "plan", "choices", "limits")
        return {key: head[key] for key in keys} | self.folder.provenance

    @cached_property
    def plan(self) -> Plan:
        """The frozen plan."""
        return load_plan(self.folder)

    @cached_property
    def faults(self) -> dict[str, Fault]:
        """The planned faults by id: value, aim, and what is injected where."""
        return plan_file.read_faults(self.path)

    @cached_property
    def experiments(self) -> dict[str, Experiment]:
        """The planned experiments by id, in plan order."""
        return {e.id: e for e in plan_file.read_all(self.path)}

    @cached_property
    def records(self) -> Mapping[str, Record]:
        """The records by experiment id."""
        return self.folder.records()

    @cached_property
    def results(self) -> "pd.DataFrame":
        """One row per experiment with a record, indexed by its id, with the columns of results.csv, typed."""
        return Results.up_to_date(self.path).frame()

    def propagation(self) -> "pd.DataFrame":
        """Return, for each experiment, one row for each channel that differs from the golden run, with the
        columns of propagation.parquet.

        MutatorError for a run of an older version that did not record these differences.
        """
        return Results.up_to_date(self.path).propagation()

    @property
    def endings(self) -> dict[str, int]:
        """Number of experiments by ending: the outcome of runs that ended normally, the status of others."""
        return counting.outcome_counts(self._texts)

    @property
    def harness_errors(self) -> dict[str, str]:
        """Experiments in which the harness failed, with the reasons; `mutator.run` retries them."""
        texts = self._texts
        failed = texts[texts["status"] == Status.HARNESS_ERROR.value]
        return dict(zip(failed["experiment_id"], failed["detail"], strict=True))

    @property
    def verifiable(self) -> bool:
        """Whether the content can be verified; runs of older schemas have no digests."""
        return self.folder.verifiable

    @cached_property
    def _texts(self) -> "pd.DataFrame":
        return Results.up_to_date(self.path).texts()

    @cached_property
    def fault_paths(self) -> FaultPaths | None:
        """The paths of faults through the target; None if unknown."""
        return fault_paths_of(self.folder.head)

    @cached_property
    def traces(self) -> Traces:
        """The traces. Traces that the run folder lacks are made when needed."""
        return Traces(self.workspace, self.folder)

    def _workspace_if_any(self) -> Workspace | None:
        try:
            return self.workspace
        except MutatorError:
            return None
