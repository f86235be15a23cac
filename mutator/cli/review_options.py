"""Options that the subcommands of `review` share: which groups, and who reviews."""

from dataclasses import dataclass
from typing import Annotated

import typer

import mutator
from mutator._common.garbage_collection_pause import without_garbage_collection
from mutator.cli import shell_completion
from mutator.cli.shared_options import Manifest, Reading, Seed, WorkspaceOptions
from mutator.cli.terminal_output import Terminal
from mutator.errors import MutatorError
from mutator.review.group_filter_columns import GROUP_FILTER_COLUMNS

Campaign = Annotated[
    str | None,
    typer.Option(metavar="NAME", help="Only groups that this campaign runs, with its readings and triggers."),
]
Specs = Annotated[
    list[str] | None,
    typer.Option("--spec", metavar="SPEC", help="Only these specs, globs or spec files; repeatable."),
]
OnlyGroups = Annotated[
    str | None,
    typer.Option(
        "--only",
        metavar="EXPR",
        help=f"Only groups that match. Columns: {', '.join(GROUP_FILTER_COLUMNS)}.",
        autocompletion=shell_completion.complete_group_columns,
    ),
]
ExcludeGroups = Annotated[
    str | None,
    typer.Option(
        "--exclude",
        metavar="EXPR",
        help="Leave out groups that match.",
        autocompletion=shell_completion.complete_group_columns,
    ),
]
Groups = Annotated[
    list[str], typer.Argument(metavar="GROUP...", help="Ids of groups, or the start of each id.")
]
By = Annotated[
    str | None,
    typer.Option("--by", metavar="NAME", help="The reviewer. Default: user.name of your git config."),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class MutantOptions:
    """The options of every subcommand that say which mutants are reviewed."""

    campaign: Campaign = None
    specs: Specs = None
    reading: Reading = None
    seed: Seed = None
    manifest: Manifest = None

    def load(self, terminal: Terminal, workspace_options: WorkspaceOptions) -> "mutator.ReviewedGroups":
        if self.campaign and self.specs:
            raise MutatorError("--campaign together with --spec", expected="one or the other")
        workspace = workspace_options.workspace()
        # collections take a tenth of the time, also while libraries are imported
        with terminal.show_spinner("making the mutants"), without_garbage_collection():
            return mutator.load_review(
                campaign=self.campaign,
                specs=tuple(self.specs or ()),
                reading=self.reading,
                seed=self.seed,
                target=self.manifest,
                workspace=workspace,
            )


def reviewer_or_git_user(workspace_options: WorkspaceOptions, by: str | None) -> str:
    from mutator.api.reviews import reviewer_name

    name = reviewer_name(workspace_options.workspace()) if by is None else by
    if not name or not name.strip():
        raise MutatorError(
            "no reviewer",
            argument="by",
            expected="the reviewer's name",
            remedy="add `by`, or set git's user name: `git config --global user.name NAME`",
        )
    return name
