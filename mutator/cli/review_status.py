"""`review status`: the progress of a review, and the approvals that a campaign lacks."""

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import counted
from mutator.cli import review_view
from mutator.cli.console import Terminal, short_path

if TYPE_CHECKING:
    import mutator
    from mutator.review.mutant_groups import Group


def print_status(terminal: Terminal, found: "mutator.ReviewedGroups", campaign: str | None) -> None:
    review = found.review
    if terminal.as_json:
        terminal.emit(_data(found))
        return
    counts = review_view.counts(review, found.groups)
    terminal.say(f"{short_path(review.path)}: {counted(len(found.groups), 'group')}: {counts}")
    if review.four_eyes:
        terminal.say("four eyes: nobody can approve what they changed last")
    if not campaign:
        told = [(group, review.describe(group)) for group in found.groups if review.changed(group)]
        _list(terminal, "changed since the decision", told)
    flags = [(group, review.flag(group.id)) for group in found.groups]
    _list(terminal, "flagged", [(group, f"by {flag.by}") for group, flag in flags if flag])
    if campaign:
        _list(terminal, f"approvals that {campaign} lacks", found.lacking)
        if not found.lacking:
            terminal.say(f"all groups of {campaign} are approved", style="green")


def _data(found: "mutator.ReviewedGroups") -> dict[str, Any]:
    review, groups = found.review, found.groups
    states = Counter(review.state(group).value for group in groups)
    some = {
        "changed": [group for group in groups if review.changed(group)],
        "flagged": [group for group in groups if review.flag(group.id)],
        "lacking": [group for group, _ in found.lacking],
    }
    return {
        "file": str(review.path),
        "target": review.target,
        "four_eyes": review.four_eyes,
        "groups": len(groups),
        "states": {name: states[name] for name in review_view.STYLES},
        **{name: [review_view.data(review, group) for group in chosen] for name, chosen in some.items()},
    }


def _list(terminal: Terminal, head: str, rows: "Sequence[tuple[Group, str]]") -> None:
    if rows:
        terminal.say(f"{head}:", style="bold")
    for group, words in rows:
        terminal.say(f"  {group.id}  {words}: {group.what}")
