"""Plan campaigns. This module imports nothing that reads runs, so that planning starts fast."""

from pathlib import Path

from mutator.api.target_and_fault_selection import WorkspaceLike, open_workspace
from mutator.campaigns.campaign_files import load_campaign, load_campaign_study
from mutator.campaigns.defended_runs import freeze_defended_runs
from mutator.campaigns.plan import Plan, SeedBySeedPlan, build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan_with_tally
from mutator.engines.forkable import reasons_by_unforkable_variant
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
        plan = build_plan(opened_workspace, campaign, choices)
        load_campaign_study(plan.campaign)
        return plan
    planning = SeedBySeedPlan(opened_workspace, campaign, choices)
    folder, tally = freeze_plan_with_tally(planning, Path(out), opened_workspace)
    freeze_defended_runs(opened_workspace, folder, planning.campaign.defence_sets)
    return load_plan(folder, tally)  # reading it back adds the cost measured in this folder, if any


def explores(workspace: Workspace, campaign: str | Path) -> bool:
    """Whether results of a campaign decide which experiments follow."""
    return load_campaign(workspace.campaign(campaign)).exploration_request is not None


def reasons_not_to_fork(plan: Plan, workspace: Workspace) -> dict[str, str]:
    """Return the variants of a plan that only the reference engine can run, with the reasons."""
    faults = plan.tally.example_fault_by_variant.values()
    return reasons_by_unforkable_variant(
        workspace.manifest(plan.campaign.target), workspace.fault_models(), faults
    )
