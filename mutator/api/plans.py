"""Plan campaigns. This module imports nothing that reads runs, so that planning starts fast."""

from pathlib import Path

from mutator.api.selection import WorkspaceLike, open_workspace
from mutator.campaigns.freezing import freeze_and_tell
from mutator.campaigns.plan import Plan, Planning, load_plan, make_plan
from mutator.engines.forkable import not_forked
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


def plan(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    choices: Choices | None = None,
    workspace: WorkspaceLike = None,
) -> Plan:
    """Expand a campaign (a name in the library, or a file) into its experiments, without running any.

    With `out`, the plan is frozen there, and `run` with the same folder runs exactly these experiments.
    MutatorError for a mistake in the campaign or choices, if no experiment is left, and for a folder with
    other content.
    """
    opened_workspace = open_workspace(workspace)
    if out is None:
        return make_plan(opened_workspace, campaign, choices)
    planning = Planning(opened_workspace, campaign, choices)
    folder, tally = freeze_and_tell(planning, Path(out), opened_workspace)
    return load_plan(folder, tally)  # reading it back adds the cost measured in this folder, if any


def reasons_not_to_fork(plan: Plan, workspace: Workspace) -> dict[str, str]:
    """Return the variants of a plan that only the reference engine can run, with the reasons."""
    faults = plan.tally.variants.values()
    return not_forked(workspace.manifest(plan.campaign.target), workspace.fault_models(), faults)
