"""The contents of a run folder, each part read on first use."""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from mutator._common.hashing import as_json_types
from mutator.api.run_envelopes import RunEnvelope, envelopes_of_replay
from mutator.api.stored_experiments import StoredRun
from mutator.campaigns.plan import Plan, load_plan
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.run_traces import RunTraces
from mutator.explore.exploration_replay import ExplorationReplay, is_exploration, replay_exploration
from mutator.explore.finding_search import Finding, FindingSearch
from mutator.model import Status
from mutator.results import outcome_counting
from mutator.results.table_reader import Results
from mutator.workspace import Workspace

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class RunContents(StoredRun):
    """A run folder and its workspace."""

    @property
    def provenance(self) -> dict[str, Any]:
        """Campaign, target, seed, reading and choices; digests of the sources; under `stretches`, the
        versions and machine of each stretch of work.
        """
        head = self.folder.head
        return {
            "campaign": head.campaign,
            "target": head.target,
            "plan": head.plan,
            "choices": as_json_types(head.choices),
            "limits": as_json_types(head.limits),
            **self.folder.provenance,
        }

    @cached_property
    def plan(self) -> Plan:
        """The frozen plan."""
        return load_plan(self.folder)

    @cached_property
    def results(self) -> "pd.DataFrame":
        """One row per experiment with a record, indexed by its id, with the columns of results.csv, typed."""
        return Results.up_to_date(self.path).indexed_frame()

    def propagation(self) -> "pd.DataFrame":
        """Return, for each experiment, one row for each channel that differs from the golden run, with the
        columns of propagation.parquet.
        """
        return Results.up_to_date(self.path).propagation()

    @property
    def endings(self) -> dict[str, int]:
        """Number of experiments by ending: the outcome of runs that ended normally, the status of others."""
        return outcome_counting.count_by_outcome_or_status(self._results_frame)

    @property
    def harness_errors(self) -> dict[str, str]:
        """Experiments in which the harness failed, with the reasons; `mutator.run` retries them."""
        frame = self._results_frame
        failed = frame[frame["status"] == Status.HARNESS_ERROR.value]
        return dict(zip(failed["experiment_id"], failed["detail"], strict=True))

    @cached_property
    def envelopes(self) -> tuple[RunEnvelope, ...]:
        """What an exploration says of each fault, scenario and start that it has begun, from its plan and
        records; empty for other runs. CheckFailed if the plan does not follow from the records.
        """
        return envelopes_of_replay(self._replay) if self._replay else ()

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """What a search has found: hazards, each with the smallest fault that reached it; empty for other
        runs. CheckFailed as for `envelopes`.
        """
        search = self._replay.exploration if self._replay else None
        return tuple(search.findings()) if isinstance(search, FindingSearch) else ()

    @cached_property
    def _replay(self) -> ExplorationReplay | None:
        """The exploration, from its plan and records; None for other runs."""
        if not is_exploration(self.folder):
            return None
        replay = replay_exploration(self.folder, self.manifest)
        for difference in replay.differences:
            raise CheckFailed(difference.got, where=difference.where, expected=difference.expected)
        return replay

    @cached_property
    def _results_frame(self) -> "pd.DataFrame":
        return Results.up_to_date(self.path).frame()

    @cached_property
    def traces(self) -> RunTraces:
        """The traces. Traces that the run folder lacks are made when needed."""
        return RunTraces(self.workspace, self.folder)

    def _workspace_if_any(self) -> Workspace | None:
        try:
            return self.workspace
        except MutatorError:
            return None
