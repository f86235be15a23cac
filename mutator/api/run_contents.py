"""What a run folder holds, each part read when it is first asked for."""

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
from mutator.outcomes import counting
from mutator.outcomes.paths import Ways, ways_of
from mutator.outcomes.reader import Results
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd


def from_here(path: Path) -> Path:
    """A path as it is typed in the folder one is in."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


@dataclass(frozen=True, eq=False, repr=False)
class RunContents:
    """A run folder, and the workspace that it is looked at with (None: found when needed)."""

    folder: RunFolder  #: reads the files of the run folder
    given_workspace: Workspace | None = None  #: the workspace that was passed; None: found when needed

    @property
    def path(self) -> Path:
        """The folder."""
        return self.folder.path

    @cached_property
    def workspace(self) -> Workspace:
        """Library, templates and target that the run is looked at with."""
        return self.given_workspace or Workspace.find()

    @cached_property
    def bench(self) -> Bench:
        """The run's target in that workspace."""
        return Bench.of(self.workspace, self.folder.head["target"])

    @property
    def provenance(self) -> dict[str, Any]:
        """Campaign, target, seed, reading and choices; digests of the sources; what each stretch of work ran
        with, under `stretches`."""
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
        """The planned experiments by id, in the plan's order."""
        return {e.id: e for e in plan_file.read_all(self.path)}

    @cached_property
    def records(self) -> Mapping[str, Record]:
        """The record of each experiment that has one, by id."""
        return self.folder.records()

    @cached_property
    def results(self) -> "pd.DataFrame":
        """A row per experiment that has a record, by experiment id: the columns of results.csv, typed.

        As `mutator.outcomes.reader.Results.frame` makes it; the table is brought up to date first.
        """
        return Results.up_to_date(self.path).frame()

    def propagation(self) -> "pd.DataFrame":
        """A row for each channel of an experiment that left golden: the columns of propagation.parquet.

        The table is brought up to date first. MutatorError for a run of a version that recorded none.
        """
        return Results.up_to_date(self.path).propagation()

    @property
    def endings(self) -> dict[str, int]:
        """How many experiments ended how: outcomes of those that ended well, statuses of the others."""
        return counting.outcome_counts(self._texts)

    @property
    def harness_errors(self) -> dict[str, str]:
        """Experiments that the harness failed at, and why; `mutator.run` tries them again."""
        texts = self._texts
        failed = texts[texts["status"] == Status.HARNESS_ERROR.value]
        return dict(zip(failed["experiment_id"], failed["detail"], strict=True))

    @property
    def verifiable(self) -> bool:
        """Whether its content can be verified; runs of earlier schemas have no digests."""
        return self.folder.verifiable

    @cached_property
    def _texts(self) -> "pd.DataFrame":
        return Results.up_to_date(self.path).texts()

    @cached_property
    def ways(self) -> Ways | None:
        """The ways of faults through its target; None where they are not known."""
        return ways_of(self.folder.head)

    @cached_property
    def traces(self) -> Traces:
        """Traces that are kept in the run folder, and those that are driven when needed."""
        return Traces(self.workspace, self.folder)

    def _workspace_if_any(self) -> Workspace | None:
        try:
            return self.workspace
        except MutatorError:
            return None
