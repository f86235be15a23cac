"""`review`: review groups of mutants that differ only in values."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

import mutator
from mutator._common.message_text import counted
from mutator.cli import review_decision_commands, review_group_printing
from mutator.cli.review_options import (
    By,
    ExcludeGroups,
    Groups,
    MutantOptions,
    OnlyGroups,
    reviewer_or_git_user,
)
from mutator.cli.shared_options import Json, Wide, WorkspaceOptions, with_workspace_options
from mutator.cli.subcommand_help import NamedValuesCommand
from mutator.cli.terminal_output import Terminal, short_path

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


class ReviewSubcommands(TyperGroup):
    """The subcommands of `review`; the default is `list`."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert `list` unless the first argument is a subcommand or asks for help."""
        if not args or (args[0].startswith("-") and args[0] not in ("-h", "--help")):
            args = ["list", *args]
        return super().parse_args(ctx, args)


def register(app: typer.Typer) -> None:
    reviews = typer.Typer(
        cls=ReviewSubcommands,
        rich_markup_mode=None,
        epilog=EXAMPLES,
        context_settings={"max_content_width": 110},
    )
    reviews.callback()(review)
    for name, verb in (
        ("list", list_groups),
        ("show", show),
        ("status", status),
        ("approve", review_decision_commands.approve),
        ("reject", review_decision_commands.reject),
        ("clear", review_decision_commands.clear),
        ("remark", review_decision_commands.remark),
        ("flag", review_decision_commands.flag),
        ("unflag", review_decision_commands.unflag),
        ("walk", walk),
        ("page", page),
    ):
        reviews.command(name, cls=NamedValuesCommand)(verb)
    app.add_typer(reviews, name="review")


def review() -> None:
    """Review generated mutants: approve or reject groups of diffs."""


@with_workspace_options
def list_groups(
    only: OnlyGroups = None,
    exclude: ExcludeGroups = None,
    *,
    mutant_options: MutantOptions,
    wide: Wide = False,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """List groups, new and changed ones first (the default)."""
    terminal = Terminal(as_json, wide)
    reviewed = mutant_options.load(terminal, workspace_options).matching(only, exclude)
    review_group_printing.print_group_list(terminal, reviewed.review, reviewed.groups)


@with_workspace_options
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
    mutant_options: MutantOptions,
    wide: Wide = False,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Show a group: its diff with holes, and the values that fill them."""
    terminal = Terminal(as_json, wide)
    reviewed = mutant_options.load(terminal, workspace_options)
    selected = reviewed.find(groups)
    for group in () if as_json else selected:
        (
            review_group_printing.print_changes_since_decision
            if changes
            else review_group_printing.print_group
        )(terminal, reviewed.review, group)
    pictures_by_group: dict[str, dict[str, str]] = {}
    if pictures:
        pictures_by_group = _write_pictures(
            terminal, workspace_options, reviewed.review.target, selected, pictures
        )
    if as_json:
        facts = [
            review_group_printing.group_as_json(reviewed.review, group, with_diff_and_values=True)
            for group in selected
        ]
        terminal.print_json(
            [
                {**group_data, "pictures": pictures_by_group.get(str(group_data["group"]), {})}
                for group_data in facts
            ]
        )


def _write_pictures(
    terminal: Terminal,
    workspace_options: WorkspaceOptions,
    target: str,
    groups: "Sequence[Group]",
    folder: Path,
) -> dict[str, dict[str, str]]:
    from mutator.api.reviews import write_pictures

    with terminal.show_spinner("drawing"):
        files_by_group, value_by_file = write_pictures(
            groups, target, folder, workspace=workspace_options.workspace()
        )
    for path, value in value_by_file.items():
        terminal.print_text(short_path(Path(path)) + (f": {value}" if value else ""))
    for group in groups:
        if group.id not in files_by_group:
            terminal.print_note(f"{group.id} has no pictures: it is not an image effect in a single place")
    return files_by_group


@with_workspace_options
def status(
    *,
    mutant_options: MutantOptions,
    wide: Wide = False,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Show the review's progress: groups by state, changes since the decision, flags. With --campaign, also
    the approvals that the campaign lacks.
    """
    from mutator.cli.review_status_printing import print_status

    terminal = Terminal(as_json, wide)
    reviewed = mutant_options.load(terminal, workspace_options)
    print_status(terminal, reviewed, mutant_options.campaign)


@with_workspace_options
def walk(
    by: By = None,
    only: OnlyGroups = None,
    exclude: ExcludeGroups = None,
    *,
    mutant_options: MutantOptions,
    workspace_options: WorkspaceOptions,
) -> None:
    """Show new and changed groups one by one, and ask for a decision on each."""
    from mutator.cli.review_walk import review_one_by_one

    terminal = Terminal()

    def load_groups() -> "mutator.ReviewedGroups":
        reviewed = mutant_options.load(terminal, workspace_options)
        return reviewed.matching(only, exclude)

    review_one_by_one(terminal, load_groups, lambda: reviewer_or_git_user(workspace_options, by))


@with_workspace_options
def page(
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The page, an .html file.")],
    only: OnlyGroups = None,
    exclude: ExcludeGroups = None,
    *,
    mutant_options: MutantOptions,
    as_json: Json = False,
    workspace_options: WorkspaceOptions,
) -> None:
    """Write all groups to one self-contained page, with commands to copy."""
    terminal = Terminal(as_json)
    reviewed = mutant_options.load(terminal, workspace_options).matching(only, exclude)
    reviewed.write_page(out)
    if as_json:
        terminal.print_json({"page": str(out), "groups": len(reviewed.groups)})
    terminal.print_text(
        f"{counted(len(reviewed.groups), 'group')} in {short_path(out)} ({out.stat().st_size / 1e6:.2f} MB)"
    )
