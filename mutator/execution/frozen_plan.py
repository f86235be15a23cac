"""Open the frozen plan in a run folder, or make a new one."""

from dataclasses import asdict
from pathlib import Path

from mutator._common.hashing import digest
from mutator.campaigns.campaign_files import load_campaign
from mutator.campaigns.plan import SeedBySeedPlan, build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan_in_owned_folder
from mutator.campaigns.run_inputs import RunInputs
from mutator.campaigns.run_provenance import check_sources, check_version
from mutator.errors import MutatorError
from mutator.review import approval_gate
from mutator.store.plan_choices import Choices
from mutator.store.recorded_approvals import write_approvals
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


def open_or_freeze_run(
    workspace: Workspace, campaign: str | Path, out: Path, choices: Choices, *, reviewed: bool
) -> RunFolder:
    """Open the run folder `out`, which the caller owns, with a frozen plan of the campaign.

    With `reviewed`, also store the approvals. If anything is not approved, raise CheckFailed and store no new
    plan. Raises MutatorError if the folder has a different plan, sources or version of mutator.
    """
    if RunFolder.exists(out):
        folder = _open_existing_run(workspace, campaign, out, choices)
        approvals = approval_gate.require_approvals(workspace, load_plan(folder)) if reviewed else None
    else:
        planning = SeedBySeedPlan(workspace, campaign, choices)
        approvals = (
            approval_gate.require_approvals(workspace, build_plan(workspace, campaign, choices))
            if reviewed
            else None
        )
        folder, _ = freeze_plan_in_owned_folder(planning, out, workspace)
    if approvals is not None:
        write_approvals(folder.path, approvals)
    return folder


def _open_existing_run(workspace: Workspace, campaign: str | Path, out: Path, choices: Choices) -> RunFolder:
    folder = RunFolder.open(out)
    head = folder.head
    check_version(folder)
    loaded = load_campaign(workspace.campaign(campaign))
    if digest(loaded.file_bytes) != head.campaign_digest:
        raise MutatorError(
            f"holds a run of campaign '{head.campaign}' whose text differs from {loaded.path}",
            where=out,
            remedy="use another folder, or give the campaign file in the run folder: "
            + str(out / "campaign.yaml"),
        )
    for name, value in asdict(choices).items():
        frozen = getattr(head.choices, name)
        if name == "reading":
            frozen = head.reading
        elif name == "seed" and head.seeds is None:
            frozen = head.seed
        if value is not None and value != frozen:
            raise MutatorError(
                f"{name} {value}",
                where=out,
                expected="the value of this run's plan: "
                + (f"no {name}" if frozen is None else f"{name} {frozen}"),
                argument=name,
                remedy=f"leave out `{name}`, or use another folder",
            )
    check_sources(out, head.sources, RunInputs.of_run(workspace, folder).digest_by_source())
    return folder
