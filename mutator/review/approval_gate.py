"""`--require-reviewed`: a campaign runs only approved mutants, and its run folder records the approvals."""

import shlex
from typing import Any

from mutator._common.bounded_reading import read_bounded
from mutator._common.hashing import as_json_types
from mutator._common.message_text import counted
from mutator.campaigns.plan import Plan
from mutator.config.location_syntax import defence_at
from mutator.errors import CheckFailed
from mutator.review.mutant_groups import Group, groups_of_plan
from mutator.review.review_state_and_actions import Review, ReviewState, load_review
from mutator.store.recorded_approvals import APPROVALS_SCHEMA
from mutator.workspace import Workspace

_MOST_PRINTED_IDS = 10  # maximum number of ids in one printed command


def require_approvals(workspace: Workspace, plan: Plan) -> dict[str, Any]:
    """Return the decisions that allow the plan to run (canary and probe included), for
    `mutator.store.recorded_approvals`.

    With sets of defences, the same approvals hold, because a fault has the same lines there. CheckFailed
    unless every group has a valid approval, and for a fault in a defence, whose lines no group shows.
    """
    _check_no_fault_is_in_defence(plan)
    manifest = workspace.manifest(plan.campaign.target)
    groups = groups_of_plan(workspace, plan)
    review = load_review(workspace, manifest.name)
    refused = [group for group in groups if review.state(group) is not ReviewState.APPROVED]
    if refused:
        raise _unapproved_error(workspace, plan, review, refused)
    decisions = [_approval_as_json(review, group) for group in groups]
    return {"schema": APPROVALS_SCHEMA, "target": manifest.name, "groups": decisions}


def _check_no_fault_is_in_defence(plan: Plan) -> None:
    faults = (experiment.fault for experiment in plan.experiments) if plan.campaign.defence_sets else ()
    for fault in faults:
        for injection in fault.injections:
            if defence := defence_at(injection.location.path):
                raise CheckFailed(
                    f"{fault.spec} changes the defence {defence}, which the target's own tree does not have",
                    where=plan.campaign.path,
                    expected="with --require-reviewed, faults in the target alone: only they are shown",
                    remedy="leave out the fault, or run the campaign without --require-reviewed",
                )


def _approval_as_json(review: Review, group: Group) -> dict[str, Any]:
    remarks = [as_json_types(remark) for remark in review.remarks(group.id)]
    return {**as_json_types(review.decision(group.id)), "remarks": remarks}


def _unapproved_error(
    workspace: Workspace, plan: Plan, review: Review, unapproved_groups: list[Group]
) -> CheckFailed:
    lines = [
        f"  {group.id}  {unapproved_reason(review, group)}, {describe_experiment_count(group)}: {group.label}"
        for group in review.in_list_order(unapproved_groups)
    ]
    several = len(unapproved_groups) > 1
    subject = f"{len(unapproved_groups)} groups of mutants are" if several else "a group of mutants is"
    options = f"--campaign {_campaign_argument(workspace, plan)}"
    options += f" --reading {plan.reading}" if plan.choices.reading else ""
    approve_command = ""
    if len(unapproved_groups) <= _MOST_PRINTED_IDS:
        ids = " ".join(group.id for group in unapproved_groups)
        approve_command = f"; or approve {'all of them' if several else 'it'}: "
        approve_command += f"`mutator review approve {ids} {options} --by NAME`"
    return CheckFailed(
        "\n".join([f"{subject} not approved:", *lines]),
        where=review.path,
        expected="a valid approval of each group",
        remedy=f"review {'them' if several else 'it'}: `mutator review walk {options} --by NAME`"
        f"{approve_command}",
    )


def unapproved_reason(review: Review, group: Group) -> str:
    """Why a group cannot run: `missing`, what has `changed`, or who `rejected` it."""
    state, decision = review.state(group), review.decision(group.id)
    if decision is None:
        return "missing"
    if state is ReviewState.CHANGED:
        return f"changed ({', '.join(review.stale_parts(group))})"
    return decision.summary


def describe_experiment_count(group: Group) -> str:
    """Return the group's share of a campaign as text: a number of experiments, or only the canary."""
    return counted(group.experiment_count, "experiment") if group.experiment_count else "the canary"


def _campaign_argument(workspace: Workspace, plan: Plan) -> str:
    """Return the campaign's name if the library's file of that name has the same text, else its file."""
    name = plan.campaign.name
    is_in_library = name in workspace.campaigns
    is_same = is_in_library and read_bounded(workspace.campaign(name)) == plan.campaign.file_bytes
    return name if is_same else shlex.quote(str(plan.campaign.path))
