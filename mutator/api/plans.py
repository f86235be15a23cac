"""Campaigns: planned. Needs nothing of what reads a run, so a plan does not wait for reports to be loaded."""

from pathlib import Path

from mutator.api.selection import WorkspaceLike, open_workspace
from mutator.campaigns.freezing import freeze_and_tell
from mutator.campaigns.plans import Choices, Plan, Planning, load_plan, make_plan
from mutator.engines.forkable import not_forked
from mutator.workspace import Workspace


def plan(
    campaign: str | Path,
    out: str | Path | None = None,
    *,
    choices: Choices | None = None,
    workspace: WorkspaceLike = None,
) -> Plan:
    """Expand a campaign (a name of the library or a file) into its experiments; none is run.

    With `out` the plan is frozen there: `run` with the same folder runs exactly these experiments. It is then
    written seed by seed, and the experiments of a very large one are read when asked for.
    MutatorError for a mistake in campaign or choices, when no experiment is left, and for a folder that holds
    anything else.
    """
    found = open_workspace(workspace)
    if out is None:
        return make_plan(found, campaign, choices)
    planning = Planning(found, campaign, choices)
    folder, tally = freeze_and_tell(planning, Path(out), found)
    return load_plan(folder, tally)  # knows what a run took, once one was driven here


def not_forkable(plan: Plan, workspace: Workspace) -> dict[str, str]:
    """The variants of a plan that only the reference engine can run, and why."""
    faults = plan.tally.variants.values()
    return not_forked(workspace.manifest(plan.campaign.target), workspace.fault_models(), faults)
