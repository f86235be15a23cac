"""`--require-reviewed`: nothing is run that nobody has approved, and a run says who approved what it ran."""

import shlex
from collections import Counter
from pathlib import Path
from typing import Any

from mutator._common.files import read_json, write_json
from mutator._common.hashing import plain
from mutator._common.text import counted
from mutator.campaigns.plans import Plan
from mutator.errors import CheckFailed
from mutator.review.catalogue import Group, of_plan
from mutator.review.decisions import Review, State, load_review
from mutator.workspace import Workspace

SCHEMA = "reviewed/1"
FILE = "reviewed.json"
_NAMED = 10  # ids in one printed command


def approvals(workspace: Workspace, plan: Plan) -> dict[str, Any]:
    """The decisions that allow the plan to run (canary and probe included), for `write`.

    CheckFailed, which names the groups and how to look at them, unless each group is approved as it is now.
    """
    manifest = workspace.manifest(plan.campaign.target)
    groups = of_plan(workspace, plan)
    review = load_review(workspace, manifest.name)
    refused = [group for group in groups if review.state(group) is not State.APPROVED]
    if refused:
        raise _refusal(workspace, plan, review, refused)
    decisions = [plain(review.decisions[group.id]) for group in groups]
    return {"schema": SCHEMA, "target": manifest.name, "groups": decisions}


def write(run: Path, approvals: dict[str, Any]) -> None:
    """Keep in the run folder what was approved, by whom, and the digests of what they saw."""
    write_json(run / FILE, approvals)


def told(run: Path) -> str:
    """For a report: what of the run was reviewed; empty when nobody asked for it."""
    if not (run / FILE).exists():
        return ""
    groups = read_json(run / FILE, SCHEMA)["groups"]
    names = Counter(group["by"] for group in groups)
    return f"all of {counted(len(groups), 'group')} approved, by " + ", ".join(
        f"{name} ({n})" for name, n in sorted(names.items())
    )


def _refusal(workspace: Workspace, plan: Plan, review: Review, refused: list[Group]) -> CheckFailed:
    lines = [
        f"  {group.id}  {review.state(group)}, {_of(group)}: {group.what}"
        for group in review.in_turn(refused)
    ]
    many = f"{len(refused)} groups of mutants are" if len(refused) > 1 else "a group of mutants is"
    ids = " ".join(group.id for group in refused) if len(refused) <= _NAMED else "GROUP..."
    wanted = f"--campaign {_name(workspace, plan)}"
    wanted += f" --reading {plan.reading}" if plan.choices.reading else ""
    return CheckFailed(
        "\n".join([f"{many} not approved:", *lines]),
        where=review.path,
        expected="an approval of each, as it is now",
        remedy=f"look: `mutator review {wanted}`; approve: `mutator review approve {ids} {wanted} --by NAME`",
    )


def _of(group: Group) -> str:
    """What of a campaign a group is: so many experiments, or the canary alone."""
    return counted(group.runs, "experiment") if group.runs else "the canary"


def _name(workspace: Workspace, plan: Plan) -> str:
    """The campaign as a command names it: by its name where that means this text, else by its file."""
    name = plan.campaign.name
    known = name in workspace.campaigns
    same = known and workspace.campaign(name).read_bytes() == plan.campaign.source
    return name if same else shlex.quote(str(plan.campaign.path))
