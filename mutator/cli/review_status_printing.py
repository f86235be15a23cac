"""`review status`: the progress of a review, and the approvals that a campaign lacks."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import counted
from mutator.cli import review_group_printing
from mutator.cli.terminal_output import Terminal, short_path

if TYPE_CHECKING:
    import mutator
    from mutator.review.mutant_groups import Group


def print_status(terminal: Terminal, reviewed: "mutator.ReviewedGroups", campaign: str | None) -> None:
    review = reviewed.review
    if terminal.as_json:
        terminal.print_json(_status_as_json(reviewed))
        return
    counts = review_group_printing.describe_counts(review, reviewed.groups)
    terminal.print_text(f"{short_path(review.path)}: {counted(len(reviewed.groups), 'group')}: {counts}")
    if review.four_eyes:
        terminal.print_text("four eyes: nobody can approve what they changed last")
    if not campaign:
        changed = [
            (group, review.describe_decision(group)) for group in reviewed.groups if review.stale_parts(group)
        ]
        _print_groups(terminal, "changed since the decision", changed)
    flags = [(group, review.flag(group.id)) for group in reviewed.groups]
    _print_groups(terminal, "flagged", [(group, f"by {flag.by}") for group, flag in flags if flag])
    if campaign:
        _print_groups(terminal, f"approvals that {campaign} lacks", reviewed.lacking)
        if not reviewed.lacking:
            terminal.print_text(f"all groups of {campaign} are approved", style="green")


def _status_as_json(reviewed: "mutator.ReviewedGroups") -> dict[str, Any]:
    review, groups = reviewed.review, reviewed.groups
    states = Counter(review.state(group).value for group in groups)
    groups_by_list = {
        "changed": [group for group in groups if review.stale_parts(group)],
        "flagged": [group for group in groups if review.flag(group.id)],
        "lacking": [group for group, _ in reviewed.lacking],
    }
    return {
        "file": str(review.path),
        "target": review.target,
        "four_eyes": review.four_eyes,
        "groups": len(groups),
        "states": {name: states[name] for name in review_group_printing.STYLE_BY_STATE},
        **{
            name: [review_group_printing.group_as_json(review, group) for group in listed]
            for name, listed in groups_by_list.items()
        },
    }


def _print_groups(terminal: Terminal, heading: str, groups_with_notes: "Sequence[tuple[Group, str]]") -> None:
    if groups_with_notes:
        terminal.print_text(f"{heading}:", style="bold")
    for group, note in groups_with_notes:
        terminal.print_text(f"  {group.id}  {note}: {group.label}")
