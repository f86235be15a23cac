"""The subcommands of `review` that record decisions: approve, reject, clear, remark, flag, unflag."""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli import review_view
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import Json, Place, with_place
from mutator.cli.review_options import By, Groups, MutantOptions, OnlyGroups, reviewer
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.review.mutant_groups import Group

SomeGroups = Annotated[
    list[str] | None,
    typer.Argument(metavar="[GROUP...]", help="Ids of groups, or the start of each id; not with --only."),
]
Yes = Annotated[
    bool, typer.Option("--yes", "-y", help="Do not ask for confirmation of the groups that --only finds.")
]
Remark = Annotated[str, typer.Option(metavar="TEXT", help="Add this remark to each group.")]


def _deciding(kind: str, about: str) -> Callable[..., None]:
    @with_place
    def verb(
        groups: SomeGroups = None,
        by: By = None,
        remark: Remark = "",
        only: OnlyGroups = None,
        yes: Yes = False,
        *,
        mutants: MutantOptions,
        as_json: Json = False,
        place: Place,
    ) -> None:
        terminal, name = Terminal(as_json), reviewer(place, by)
        found = mutants.load(terminal, place)
        if chosen := _chosen(found, kind, groups, only, yes=yes):
            decide = found.approve if kind == "approve" else found.reject
            _tell(terminal, decide(chosen, name, remark), chosen)

    verb.__doc__ = about
    return verb


approve = _deciding("approve", "Approve groups in their current state, by id or by filter.")
reject = _deciding("reject", "Reject groups in their current state: `run --require-reviewed` refuses them.")


@with_place
def clear(
    groups: Groups,
    by: By = None,
    remark: Remark = "",
    *,
    mutants: MutantOptions,
    as_json: Json = False,
    place: Place,
) -> None:
    """Withdraw decisions; remarks and flags stay."""
    terminal, name = Terminal(as_json), reviewer(place, by)
    found = mutants.load(terminal, place)
    _tell(terminal, found.clear(chosen := found.find(groups), name, remark), chosen)


@with_place
def remark(
    groups: Groups,
    text: Annotated[str, typer.Option("--text", metavar="TEXT", help="The remark, one line.")],
    by: By = None,
    *,
    mutants: MutantOptions,
    as_json: Json = False,
    place: Place,
) -> None:
    """Add a remark to groups."""
    terminal, name = Terminal(as_json), reviewer(place, by)
    found = mutants.load(terminal, place)
    _tell(terminal, found.remark(chosen := found.find(groups), name, text), chosen)


def _flagging(flag: bool, about: str) -> Callable[..., None]:
    @with_place
    def verb(
        groups: Groups,
        by: By = None,
        *,
        mutants: MutantOptions,
        as_json: Json = False,
        place: Place,
    ) -> None:
        terminal, name = Terminal(as_json), reviewer(place, by)
        found = mutants.load(terminal, place)
        chosen = found.find(groups)
        _tell(terminal, (found.flag if flag else found.unflag)(chosen, name), chosen)

    verb.__doc__ = about
    return verb


flag = _flagging(True, "Flag groups for another look.")
unflag = _flagging(False, "Remove flags.")


def _chosen(
    found: "mutator.ReviewedGroups", verb: str, starts: Sequence[str] | None, only: str | None, *, yes: bool
) -> "Sequence[Group]":
    """Return the chosen groups, or none without the user's confirmation."""
    if bool(starts) == (only is not None):
        raise MutatorError(
            "groups together with --only" if starts else "neither groups nor --only",
            where=f"mutator review {verb}",
            expected="either the ids of groups or --only",
        )
    if starts:
        return found.find(starts)
    chosen = found.matching(only).groups
    if not chosen:
        raise MutatorError(
            f"no group matches {only}", argument="only", remedy="list the groups: `mutator review`"
        )
    many = f"{counted(len(chosen), 'group')} ({review_view.counts(found.review, chosen)})"
    if not yes:
        if not sys.stdin.isatty():
            raise MutatorError(
                f"no terminal to ask for confirmation of {many}",
                argument="only",
                remedy=f"add --yes to {verb} without confirmation",
            )
        if not typer.confirm(f"{verb} {many}?"):
            return ()
    return chosen


def _tell(terminal: Terminal, found: "mutator.ReviewedGroups", groups: "Sequence[Group]") -> None:
    decided = found.review
    if terminal.as_json:
        terminal.emit([review_view.data(decided, group) for group in groups])
    for group in groups:
        state = decided.state(group).value
        words = decided.describe(group) or state
        words += ", flagged" * (decided.flag(group.id) is not None)
        terminal.say(f"{group.id} {words}", style=review_view.STYLES[state])
    terminal.say(f"{short_path(decided.path)}: {review_view.counts(decided, found.groups)}")
