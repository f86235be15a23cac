"""What a reviewer says on the command line: approve, reject, clear, remark, flag, unflag."""

import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.text import counted
from mutator.cli import review_view
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import Json, Manifest, Place, Reading, Seed, with_place
from mutator.cli.review_options import By, Campaign, Groups, OnlyGroups, Specs, load, reviewer
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.review.catalogue import Group

SomeGroups = Annotated[
    list[str] | None,
    typer.Argument(metavar="[GROUP...]", help="Ids of groups, or the starts of them; or none and --only."),
]
Yes = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask whether all that --only finds is meant.")]
Remark = Annotated[str, typer.Option(metavar="TEXT", help="Left as a remark on each group.")]


def _deciding(kind: str, about: str) -> Callable[..., None]:
    """The verb that approves, or the one that rejects."""

    @with_place
    def verb(
        groups: SomeGroups = None,
        by: By = None,
        remark: Remark = "",
        only: OnlyGroups = None,
        yes: Yes = False,
        campaign: Campaign = None,
        specs: Specs = None,
        reading: Reading = None,
        seed: Seed = None,
        manifest: Manifest = None,
        as_json: Json = False,
        *,
        place: Place,
    ) -> None:
        terminal, name = Terminal(as_json), reviewer(place, by)
        found = load(terminal, place, campaign, specs, reading, seed, manifest)
        if chosen := _chosen(found, kind, groups, only, yes=yes):
            decide = found.approve if kind == "approve" else found.reject
            _tell(terminal, decide(chosen, name, remark), chosen)

    verb.__doc__ = about
    return verb


approve = _deciding(
    "approve", "Approve groups as they are now: some by their ids, or all that a filter finds."
)
reject = _deciding("reject", "Reject groups as they are now: `run --require-reviewed` does not run them.")


@with_place
def clear(
    groups: Groups,
    by: By = None,
    remark: Remark = "",
    campaign: Campaign = None,
    specs: Specs = None,
    reading: Reading = None,
    seed: Seed = None,
    manifest: Manifest = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Take decisions back; remarks and flags stay."""
    terminal, name = Terminal(as_json), reviewer(place, by)
    found = load(terminal, place, campaign, specs, reading, seed, manifest)
    _tell(terminal, found.clear(chosen := found.find(groups), name, remark), chosen)


@with_place
def remark(
    groups: Groups,
    text: Annotated[str, typer.Option("--text", metavar="TEXT", help="What is remarked, in one line.")],
    by: By = None,
    campaign: Campaign = None,
    specs: Specs = None,
    reading: Reading = None,
    seed: Seed = None,
    manifest: Manifest = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Leave a remark on groups."""
    terminal, name = Terminal(as_json), reviewer(place, by)
    found = load(terminal, place, campaign, specs, reading, seed, manifest)
    _tell(terminal, found.remark(chosen := found.find(groups), name, text), chosen)


def _flagging(flag: bool, about: str) -> Callable[..., None]:
    """The verb that flags, or the one that takes flags off."""

    @with_place
    def verb(
        groups: Groups,
        by: By = None,
        campaign: Campaign = None,
        specs: Specs = None,
        reading: Reading = None,
        seed: Seed = None,
        manifest: Manifest = None,
        as_json: Json = False,
        *,
        place: Place,
    ) -> None:
        terminal, name = Terminal(as_json), reviewer(place, by)
        found = load(terminal, place, campaign, specs, reading, seed, manifest)
        chosen = found.find(groups)
        _tell(terminal, (found.flag if flag else found.unflag)(chosen, name), chosen)

    verb.__doc__ = about
    return verb


flag = _flagging(True, "Mark groups to be looked at again.")
unflag = _flagging(False, "Take such marks off.")


def _chosen(
    found: "mutator.ReviewedGroups", verb: str, starts: Sequence[str] | None, only: str | None, *, yes: bool
) -> "Sequence[Group]":
    """The groups that are meant; none when the answer to the question is no."""
    if bool(starts) == (only is not None):
        raise MutatorError(
            "groups together with --only" if starts else "neither groups nor --only",
            where=f"mutator review {verb}",
            expected="the ids of groups, or a filter",
        )
    if starts:
        return found.find(starts)
    chosen = found.matching(only).groups
    if not chosen:
        raise MutatorError(f"no group for which {only}", argument="only", remedy="look: `mutator review`")
    many = f"{counted(len(chosen), 'group')} ({review_view.counts(found.review, chosen)})"
    if not yes:
        if not sys.stdin.isatty():
            raise MutatorError(many, argument="only", remedy=f"say --yes to {verb} them without being asked")
        if not typer.confirm(f"{verb} {many}?"):
            return ()
    return chosen


def _tell(terminal: Terminal, found: "mutator.ReviewedGroups", groups: "Sequence[Group]") -> None:
    """What is kept of these groups now."""
    decided = found.review
    if terminal.as_json:
        terminal.emit([review_view.data(decided, group) for group in groups])
    for group in groups:
        state = decided.state(group).value
        words = decided.describe(group) or state
        words += ", flagged" * (decided.flag(group.id) is not None)
        terminal.say(f"{group.id} {words}", style=review_view.STYLES[state])
    terminal.say(f"{short_path(decided.path)}: {review_view.counts(decided, found.groups)}")
