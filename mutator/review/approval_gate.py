"""`--require-reviewed`: a campaign runs only approved mutants, and its run folder records the approvals."""

import shlex
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import as_json_types
from mutator._common.message_text import counted
from mutator.campaigns.plan import Plan
from mutator.errors import CheckFailed
from mutator.review.decisions import Review, State, load_review
from mutator.review.mutant_groups import Group, of_plan
from mutator.store.approvals import SCHEMA
from mutator.workspace import Workspace

_MOST_IDS = 10  # maximum number of ids in one printed command


def approvals(workspace: Workspace, plan: Plan) -> dict[str, Any]:
    """Return the decisions that allow the plan to run (canary and probe included), for
    `mutator.store.approvals`.

    CheckFailed unless every group has a valid approval.
    """
    manifest = workspace.manifest(plan.campaign.target)
    groups = of_plan(workspace, plan)
    review = load_review(workspace, manifest.name)
    refused = [group for group in groups if review.state(group) is not State.APPROVED]
    if refused:
        raise _refusal(workspace, plan, review, refused)
    decisions = [_kept(review, group) for group in groups]
    return {"schema": SCHEMA, "target": manifest.name, "groups": decisions}


def _kept(review: Review, group: Group) -> dict[str, Any]:
    remarks = [as_json_types(remark) for remark in review.remarks(group.id)]
    return {**as_json_types(review.decision(group.id)), "remarks": remarks}


def _refusal(workspace: Workspace, plan: Plan, review: Review, refused: list[Group]) -> CheckFailed:
    lines = [
        f"  {group.id}  {reason(review, group)}, {share(group)}: {group.what}"
        for group in review.in_turn(refused)
    ]
    several = len(refused) > 1
    many = f"{len(refused)} groups of mutants are" if several else "a group of mutants is"
    wanted = f"--campaign {_campaign(workspace, plan)}"
    wanted += f" --reading {plan.reading}" if plan.choices.reading else ""
    at_once = ""
    if len(refused) <= _MOST_IDS:
        ids = " ".join(group.id for group in refused)
        at_once = f"; or approve {'all of them' if several else 'it'}: "
        at_once += f"`mutator review approve {ids} {wanted} --by NAME`"
    return CheckFailed(
        "\n".join([f"{many} not approved:", *lines]),
        where=review.path,
        expected="a valid approval of each group",
        remedy=f"review {'them' if several else 'it'}: `mutator review walk {wanted} --by NAME`{at_once}",
    )


def reason(review: Review, group: Group) -> str:
    """Why a group cannot run: `missing`, what has `changed`, or who `rejected` it."""
    state, decision = review.state(group), review.decision(group.id)
    if decision is None:
        return "missing"
    if state is State.CHANGED:
        return f"changed ({', '.join(review.changed(group))})"
    return decision.words


def share(group: Group) -> str:
    """Return the group's share of a campaign as text: a number of experiments, or only the canary."""
    return counted(group.runs, "experiment") if group.runs else "the canary"


def _campaign(workspace: Workspace, plan: Plan) -> str:
    """Return the campaign's name if the library's file of that name has the same text, else its file."""
    name = plan.campaign.name
    known = name in workspace.campaigns
    same = known and read_bounded(workspace.campaign(name)) == plan.campaign.file_bytes
    return name if same else shlex.quote(str(plan.campaign.path))
