"""`--github`: annotations and a summary for a step of GitHub Actions, without any request to GitHub."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mutator.cli.terminal_output import with_option_names
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.api.github_output import GitHubOutput

SUMMARY_VARIABLE = "GITHUB_STEP_SUMMARY"
GitHub = Annotated[
    bool,
    typer.Option(
        "--github",
        help="In GitHub Actions: annotate the lines of the ten worst faults, and append a summary to the "
        "file in GITHUB_STEP_SUMMARY.",
    ),
]


@dataclass(frozen=True)
class GitHubStep:
    """The step in which a command runs."""

    summary_path: Path

    @classmethod
    def of_environment(cls) -> "GitHubStep":
        """Return the current step; MutatorError outside of GitHub Actions."""
        path = os.environ.get(SUMMARY_VARIABLE, "")
        if not path:
            raise MutatorError(
                f"{SUMMARY_VARIABLE} is not set",
                where="--github",
                expected="a step of GitHub Actions",
                remedy=f"leave the option out, or to try it, set {SUMMARY_VARIABLE} to a file to append to",
            )
        return cls(Path(path))

    def show(self, output: "GitHubOutput", *, to_stderr: bool) -> None:
        """Print the annotations, and append the summary. The runner reads commands on both streams."""
        stream = sys.stderr if to_stderr else sys.stdout
        for line in output.commands:
            print(line, file=stream, flush=True)
        try:
            with self.summary_path.open("a", encoding="utf-8") as file:
                file.write(output.summary)
        except OSError as err:
            raise MutatorError(
                f"cannot append to {self.summary_path}: {err.strerror}",
                where=SUMMARY_VARIABLE,
                expected="a file that can be written",
                remedy="correct the variable",
            ) from None


@contextmanager
def showing_errors(step: GitHubStep | None) -> Iterator[None]:
    """Show an error that ends the command on GitHub, too: it is not in any other output of the command."""
    try:
        yield
    except MutatorError as err:
        if step and err.where != SUMMARY_VARIABLE:
            from mutator.api.github_output import error_on_github

            step.show(error_on_github(with_option_names(err)), to_stderr=True)
        raise
