"""The subcommands of `review` that record decisions: approve, reject, clear, remark, flag, unflag."""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli import review_group_printing
from mutator.cli.review_options import By, Groups, MutantOptions, OnlyGroups, reviewer_or_git_user
from mutator.cli.shared_options import Json, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.review.mutant_groups import Group

SomeGroups = Annotated[
    list[str] | None,
    typer.Argument(metavar="GROUP", help="Ids of groups, or the start of each id; not with --only."),
]
Yes = Annotated[
    bool, typer.Option("--yes", "-y", help="Do not ask for confirmation of the groups that --only finds.")
]
Remark = Annotated[str, typer.Option(metavar="TEXT", help="Add this remark to each group.")]


@with_workspace_options
def approve(
    groups: SomeGroups = None,
    by: By = None,
    remark: Remark = "",
    only: OnlyGroups = None,
    yes: Yes = False,
    *,
    mutant_options: MutantOptions,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Approve groups in their current state, by id or by filter."""
    terminal, by_name = Terminal(as_json), reviewer_or_git_user(workspace_options, by)
    reviewed = mutant_options.load(terminal, workspace_options)
    if selected := _choose_groups(reviewed, "approve", groups, only, is_confirmed=yes):
        _print_decided(terminal, reviewed.approve(selected, by_name, remark), selected)


@with_workspace_options
def reject(
    groups: SomeGroups = None,
    by: By = None,
    reason: Annotated[str, typer.Option(metavar="TEXT", help="Why, stored with the decision.")] = "",
    remark: Remark = "",
    only: OnlyGroups = None,
    yes: Yes = False,
    *,
    mutant_options: MutantOptions,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Reject groups in their current state: `run --require-reviewed` refuses them."""
    terminal, by_name = Terminal(as_json), reviewer_or_git_user(workspace_options, by)
    reviewed = mutant_options.load(terminal, workspace_options)
    if selected := _choose_groups(reviewed, "reject", groups, only, is_confirmed=yes):
        _print_decided(terminal, reviewed.reject(selected, by_name, remark, reason), selected)


@with_workspace_options
def clear(
    groups: Groups,
    by: By = None,
    remark: Remark = "",
    *,
    mutant_options: MutantOptions,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Withdraw decisions; remarks and flags stay."""
    terminal, by_name = Terminal(as_json), reviewer_or_git_user(workspace_options, by)
    reviewed = mutant_options.load(terminal, workspace_options)
    _print_decided(terminal, reviewed.clear(selected := reviewed.find(groups), by_name, remark), selected)


@with_workspace_options
def remark(
    groups: Groups,
    text: Annotated[str, typer.Option("--text", metavar="TEXT", help="The remark, one line.")],
    by: By = None,
    *,
    mutant_options: MutantOptions,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Add a remark to groups."""
    terminal, by_name = Terminal(as_json), reviewer_or_git_user(workspace_options, by)
    reviewed = mutant_options.load(terminal, workspace_options)
    _print_decided(terminal, reviewed.remark(selected := reviewed.find(groups), by_name, text), selected)


def _build_flag_command(adds_flag: bool, help_text: str) -> Callable[..., None]:
    @with_workspace_options
    def verb(
        groups: Groups,
        by: By = None,
        *,
        mutant_options: MutantOptions,
        as_json: Json = False,
        workspace_options: WorkspaceOptions,
    ) -> None:
        terminal, by_name = Terminal(as_json), reviewer_or_git_user(workspace_options, by)
        reviewed = mutant_options.load(terminal, workspace_options)
        selected = reviewed.find(groups)
        _print_decided(
            terminal, (reviewed.flag if adds_flag else reviewed.unflag)(selected, by_name), selected
        )

    verb.__doc__ = help_text
    return verb


flag = _build_flag_command(True, "Flag groups for another look.")
unflag = _build_flag_command(False, "Remove flags.")


def _choose_groups(
    reviewed: "mutator.ReviewedGroups",
    action: str,
    id_starts: Sequence[str] | None,
    only: str | None,
    *,
    is_confirmed: bool,
) -> "Sequence[Group]":
    """Return the chosen groups, or none without the user's confirmation."""
    if bool(id_starts) == (only is not None):
        raise MutatorError(
            "groups together with --only" if id_starts else "neither groups nor --only",
            where=f"mutator review {action}",
            expected="either the ids of groups or --only",
        )
    if id_starts:
        return reviewed.find(id_starts)
    selected = reviewed.matching(only).groups
    if not selected:
        raise MutatorError(
            f"no group matches {only}", argument="only", remedy="list the groups: `mutator review`"
        )
    counts = review_group_printing.describe_counts(reviewed.review, selected)
    count_text = f"{counted(len(selected), 'group')} ({counts})"
    if not is_confirmed:
        if not sys.stdin.isatty():
            raise MutatorError(
                f"no terminal to ask for confirmation of {count_text}",
                argument="only",
                remedy=f"add --yes to {action} without confirmation",
            )
        if not typer.confirm(f"{action} {count_text}?"):
            return ()
    return selected


def _print_decided(terminal: Terminal, reviewed: "mutator.ReviewedGroups", groups: "Sequence[Group]") -> None:
    review = reviewed.review
    if terminal.as_json:
        terminal.print_json([review_group_printing.group_as_json(review, group) for group in groups])
    for group in groups:
        state = review.state(group).value
        description = review.describe_decision(group) or state
        description += ", flagged" * (review.flag(group.id) is not None)
        terminal.print_text(f"{group.id} {description}", style=review_group_printing.STYLE_BY_STATE[state])
    terminal.print_text(
        f"{short_path(review.path)}: {review_group_printing.describe_counts(review, reviewed.groups)}"
    )
