"""Print groups of mutants: as a table, one by one with diff and values, or as data."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mutator._common.message_text import counted
from mutator.cli.terminal_output import Terminal

if TYPE_CHECKING:
    from mutator.review.mutant_groups import Group
    from mutator.review.review_state_and_actions import Review

STYLE_BY_STATE = {"new": "yellow", "changed": "bold yellow", "rejected": "bold red", "approved": "green"}
MOST_VALUE_ROWS = 24  # rows of values shown in a terminal
MOST_WORDS = 3  # faults described in a terminal
MOST_CONDITIONS = 6  # conditions shown in a terminal; a group can have one for each context


def group_as_json(review: "Review", group: "Group", *, with_diff_and_values: bool = False) -> dict[str, Any]:
    """Return a group as JSON data, on request also its diff and values."""
    from mutator.api.reviews import group_facts as group_facts
    from mutator.review.group_display_texts import fault_value_table, title_lines

    decision, flag = review.decision(group.id), review.flag(group.id)
    facts = {
        **group_facts(review, group),
        "what": group.label,
        "injections": group.injection_labels,
        "about": title_lines(group),
        "words": group.fault_descriptions,
    }
    facts |= {"at": decision.at if decision else None, "changed": review.stale_parts(group)}
    facts |= {"remarks": [asdict(remark) for remark in review.remarks(group.id)]}
    facts |= {
        "flag": asdict(flag) if flag else None,
        "bound": asdict(group.basis_digests),
        "ranges": group.value_ranges,
        "units": group.unit_by_parameter,
    }
    if not with_diff_and_values:
        return facts
    heads, rows = fault_value_table(group)
    return facts | {
        "diff": group.diff,
        "changes": review.diff_since_decision(group),
        "values": [dict(zip(heads, row, strict=True)) for row in rows],
        "triggers": [asdict(trigger) for trigger in group.triggers],
    }


def describe_counts(review: "Review", groups: Sequence["Group"]) -> str:
    count_by_state = Counter(review.state(group).value for group in groups)
    return (
        ", ".join(f"{count_by_state[name]} {name}" for name in STYLE_BY_STATE if count_by_state[name])
        or "no groups"
    )


def print_group_list(terminal: Terminal, review: "Review", groups: Sequence["Group"]) -> None:
    if terminal.as_json:
        terminal.print_json([group_as_json(review, group) for group in groups])
        return
    length = terminal.id_length({*review.entry_by_group, *(g.id for g in groups)})
    rows = [
        (
            g.id[:length],
            review.state(g).value,
            _describe_group(g, in_terminal=terminal.out.is_terminal),
            _describe_trigger(g),
            len(g.faults),
            g.experiment_count,
        )
        for g in groups
    ]
    terminal.print_table(["group", "state", "what", "when", "faults", "runs"], rows, right_aligned=(4, 5))
    for group in groups:
        if (decision := review.decision(group.id)) and decision.reason:
            terminal.print_text(f"{group.id[:length]} {review.describe_decision(group)}")
    terminal.print_text(f"{counted(len(groups), 'group')}: {describe_counts(review, groups)}")
    unlisted = review.entry_by_group.keys() - {group.id for group in groups}
    if unlisted:
        terminal.print_note(f"blocks of the review file for groups that are not listed: {len(unlisted)}")


def _describe_group(group: "Group", *, in_terminal: bool) -> str:
    """Return what the group's faults are, and where; outside a terminal, each group is one line."""
    from mutator.review.group_display_texts import title_lines

    titles, injections = title_lines(group), list(map(_shorten_injection, group.injection_labels))
    return "\n".join([*titles, *injections]) if in_terminal else " ".join([*titles, "; ".join(injections)])


def _shorten_injection(injection: str) -> str:
    """Shorten the file's path to its name."""
    path, space, rest = injection.partition(" ")
    return path.rpartition("/")[2] + space + rest


def _describe_trigger(group: "Group") -> str:
    return f"{group.trigger_kinds}, {group.hold_kinds}" if group.trigger_kinds else "always"


def _print_group_head(terminal: Terminal, review: "Review", group: "Group") -> None:
    from mutator.review.group_display_texts import title_lines

    state, flag = review.state(group).value, review.flag(group.id)
    terminal.print_text(f"group {group.id}: {state}", style=STYLE_BY_STATE[state])
    for title in title_lines(group):
        terminal.print_text(title)
    if decision := review.describe_decision(group):
        terminal.print_text(decision)
    if flag:
        terminal.print_text(f"flagged by {flag.by} on {flag.at[:10]}")
    for remark in review.remarks(group.id):
        terminal.print_text(f"{remark.by}{f' on {remark.at[:10]}' if remark.at else ''}: {remark.text}")


def print_changes_since_decision(terminal: Terminal, review: "Review", group: "Group") -> None:
    _print_group_head(terminal, review, group)
    terminal.print_text(f"  {group.label}", style="bold")
    terminal.print_text()
    if changes := review.diff_since_decision(group):
        terminal.print_diff(changes)
    elif review.stale_parts(group):
        terminal.print_text("the diff that the reviewer saw was not kept")
    else:
        terminal.print_text(
            "nothing has changed since the decision" if review.decision(group.id) else "no decision yet"
        )
    terminal.print_text()


def print_group(terminal: Terminal, review: "Review", group: "Group") -> None:
    from mutator.review.group_display_texts import (
        describe_value_ranges,
        fault_value_table,
        trigger_condition_lines,
    )

    _print_group_head(terminal, review, group)
    for injection in group.injection_labels:
        terminal.print_text(f"  {injection}", style="bold")
    for words in group.fault_descriptions[:MOST_WORDS]:
        terminal.print_text(f"  {words}")
    if (more_words := len(group.fault_descriptions) - MOST_WORDS) > 0:
        terminal.print_text(f"  and {more_words} more")
    runs = "" if group.experiment_count is None else f", {counted(group.experiment_count, 'experiment')}"
    if group.value_ranges:
        terminal.print_text(f"values: {describe_value_ranges(group)}")
    terminal.print_text(f"when: {_describe_trigger(group)}; {counted(len(group.faults), 'fault')}{runs}")
    conditions = trigger_condition_lines(group.triggers)
    for line in conditions[:MOST_CONDITIONS]:
        terminal.print_text(f"  {line}")
    if (more := len(conditions) - MOST_CONDITIONS) > 0:
        terminal.print_text(f"  and {more} more")
    terminal.print_text()
    terminal.print_diff(group.diff)
    terminal.print_text()
    heads, rows = fault_value_table(group)
    if rows:
        heads = [
            f"{head} ({unit})" if (unit := group.unit_by_parameter.get(head)) else head for head in heads
        ]
        terminal.print_table(heads, rows[:MOST_VALUE_ROWS], right_aligned=range(2, len(heads)))
        if len(rows) > MOST_VALUE_ROWS:
            terminal.print_text(f"{len(rows) - MOST_VALUE_ROWS} more; `--json` has all of them")
    terminal.print_text()
