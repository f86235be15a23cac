"""`review`: review groups of mutants that differ only in values."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

import mutator
from mutator._common.message_text import counted
from mutator.cli import review_actions, review_view
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import Json, Place, with_place
from mutator.cli.review_options import (
    By,
    ExcludeGroups,
    Groups,
    MutantOptions,
    OnlyGroups,
    reviewer,
)

if TYPE_CHECKING:
    from mutator.review.mutant_groups import Group

EXAMPLES = """\b
Examples:
  mutator review                                   the whole library, new and changed groups first
  mutator review --campaign quickstart             only what one campaign runs
  mutator review --only 'state == "new" and match(file, "*radar*")'
  mutator review show 3f9a                         one group: diff with holes, values
  mutator review show 3f9a --pictures DIR          also what an image effect does to a frame
  mutator review show 3f9a --changes               what has changed since the decision
  mutator review approve 3f9a 77c0 --by "A. Reviewer" --remark "limits are right"
  mutator review approve --only 'state == "new" and model == "offset"'
  mutator review remark 3f9a --text "why not below 10 m?"
  mutator review status --campaign quickstart      outdated decisions, and approvals that the campaign lacks
  mutator review walk --by "A. Reviewer"           all new and changed groups, one by one
  mutator review page --out review.html

\b
`mutator review` without a subcommand means `mutator review list`. Decisions are kept in
fault_library/reviews/; put them under version control. `mutator run --require-reviewed` runs only mutants
that are approved there.
"""


class Verbs(TyperGroup):
    """The subcommands of `review`; the default is `list`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert `list` unless the first argument is a subcommand or asks for help."""
        if not args or (args[0].startswith("-") and args[0] not in ("-h", "--help")):
            args = ["list", *args]
        return super().parse_args(ctx, args)


def register(app: typer.Typer) -> None:
    reviews = typer.Typer(
        cls=Verbs, rich_markup_mode=None, epilog=EXAMPLES, context_settings={"max_content_width": 110}
    )
    reviews.callback()(review)
    for name, verb in (
        ("list", list_groups),
        ("show", show),
        ("status", status),
        ("approve", review_actions.approve),
        ("reject", review_actions.reject),
        ("clear", review_actions.clear),
        ("remark", review_actions.remark),
        ("flag", review_actions.flag),
        ("unflag", review_actions.unflag),
        ("walk", walk),
        ("page", page),
    ):
        reviews.command(name)(verb)
    app.add_typer(reviews, name="review")


def review() -> None:
    """Review generated mutants: approve or reject groups of diffs."""


@with_place
def list_groups(
    only: OnlyGroups = None,
    exclude: ExcludeGroups = None,
    *,
    mutants: MutantOptions,
    as_json: Json = False,
    place: Place,
) -> None:
    """List groups, new and changed ones first (the default)."""
    terminal = Terminal(as_json)
    found = mutants.load(terminal, place).matching(only, exclude)
    review_view.print_list(terminal, found.review, found.groups)


@with_place
def show(
    groups: Groups,
    changes: Annotated[
        bool, typer.Option("--changes", help="Show only what has changed since the decision, as a diff.")
    ] = False,
    pictures: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Also write frames before and after an image effect."),
    ] = None,
    *,
    mutants: MutantOptions,
    as_json: Json = False,
    place: Place,
) -> None:
    """Show a group: its diff with holes, and the values that fill them."""
    terminal = Terminal(as_json)
    found = mutants.load(terminal, place)
    shown = found.find(groups)
    for group in () if as_json else shown:
        (review_view.print_changes if changes else review_view.print_group)(terminal, found.review, group)
    written: dict[str, dict[str, str]] = {}
    if pictures:
        written = _write_pictures(terminal, place, found.review.target, shown, pictures)
    if as_json:
        facts = [review_view.data(found.review, group, whole=True) for group in shown]
        terminal.emit([{**one, "pictures": written.get(str(one["group"]), {})} for one in facts])


def _write_pictures(
    terminal: Terminal, place: Place, target: str, groups: "Sequence[Group]", folder: Path
) -> dict[str, dict[str, str]]:
    from mutator.api.reviews import write_pictures

    with terminal.wait("drawing"):
        written, values = write_pictures(groups, target, folder, workspace=place.workspace())
    for path, value in values.items():
        terminal.say(short_path(Path(path)) + (f": {value}" if value else ""))
    for group in groups:
        if group.id not in written:
            terminal.note(f"{group.id} has no pictures: it is not an image effect in a single place")
    return written


@with_place
def status(
    *,
    mutants: MutantOptions,
    as_json: Json = False,
    place: Place,
) -> None:
    """Show the review's progress: groups by state, changes since the decision, flags. With --campaign, also
    the approvals that the campaign lacks.
    """
    from mutator.cli.review_status import print_status

    terminal = Terminal(as_json)
    found = mutants.load(terminal, place)
    print_status(terminal, found, mutants.campaign)


@with_place
def walk(
    by: By = None,
    only: OnlyGroups = None,
    exclude: ExcludeGroups = None,
    *,
    mutants: MutantOptions,
    place: Place,
) -> None:
    """Show new and changed groups one by one, and ask for a decision on each."""
    from mutator.cli.review_walk import walk_through

    terminal = Terminal()

    def groups() -> "mutator.ReviewedGroups":
        found = mutants.load(terminal, place)
        return found.matching(only, exclude)

    walk_through(terminal, groups, lambda: reviewer(place, by))


@with_place
def page(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The page, an .html file.")],
    only: OnlyGroups = None,
    exclude: ExcludeGroups = None,
    *,
    mutants: MutantOptions,
    as_json: Json = False,
    place: Place,
) -> None:
    """Write all groups to one self-contained page, with commands to copy."""
    terminal = Terminal(as_json)
    found = mutants.load(terminal, place).matching(only, exclude)
    found.write_page(out)
    if as_json:
        terminal.emit({"page": str(out), "groups": len(found.groups)})
    terminal.say(
        f"{counted(len(found.groups), 'group')} in {short_path(out)} ({out.stat().st_size / 1e6:.2f} MB)"
    )
