"""Options that the verbs of `review` share, and what they choose: groups of mutants, and who speaks."""

from collections.abc import Sequence
from typing import Annotated

import typer

import mutator
from mutator.cli.console import Terminal
from mutator.cli.options import Place
from mutator.errors import MutatorError
from mutator.review.columns import COLUMNS

Campaign = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="What this campaign runs, with its readings and triggers."),
]
Specs = Annotated[
    list[str] | None,
    typer.Option("--spec", metavar="SPEC", help="Only these specs, globs or spec files; may be repeated."),
]
OnlyGroups = Annotated[
    str | None,
    typer.Option("--only", metavar="EXPR", help=f"Only groups for which this holds: {', '.join(COLUMNS)}."),
]
ExcludeGroups = Annotated[
    str | None, typer.Option("--exclude", metavar="EXPR", help="Leave out groups for which this holds.")
]
Groups = Annotated[
    list[str], typer.Argument(metavar="GROUP...", help="Ids of groups, or the starts of them.")
]
By = Annotated[
    str | None, typer.Option("--by", metavar="NAME", help="Who has looked; default: git's user.name.")
]


def load(
    terminal: Terminal,
    place: Place,
    campaign: str | None,
    specs: Sequence[str] | None,
    reading: str | None,
    seed: int | None,
    manifest: str | None,
) -> "mutator.ReviewedGroups":
    """The groups that the options choose, and what was said of them."""
    if campaign and specs:
        raise MutatorError("--campaign together with --spec", expected="one or the other")
    workspace = place.workspace()
    with terminal.wait("making the mutants"):
        return mutator.load_review(
            campaign=campaign,
            specs=tuple(specs or ()),
            reading=reading,
            seed=seed,
            target=manifest,
            workspace=workspace,
        )


def reviewer(place: Place, by: str | None) -> str:
    """Who speaks: the name that was given, or git's; MutatorError for nobody."""
    from mutator.api.reviews import reviewer_name

    name = reviewer_name(place.workspace()) if by is None else by
    if not name or not name.strip():
        raise MutatorError(
            "no name",
            argument="by",
            expected="who has reviewed",
            remedy="give `by`, or tell git: `git config user.name NAME`",
        )
    return name
