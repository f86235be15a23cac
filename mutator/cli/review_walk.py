"""`review walk`: review groups one by one, with one key each."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import typer

from mutator.cli import review_group_printing
from mutator.cli.terminal_output import Terminal, short_path, show_error
from mutator.errors import MutatorError

if TYPE_CHECKING:
    import mutator

ACTION_BY_KEY = {"a": "approve", "r": "reject", "s": "skip", "q": "quit"}


def review_one_by_one(
    terminal: Terminal, load_groups: Callable[[], "mutator.ReviewedGroups"], name_reviewer: Callable[[], str]
) -> None:
    """Show each new or changed group, ask for a decision, and save it at once. Ask again if somebody else has
    decided in the meantime. MutatorError without a terminal.
    """
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise MutatorError(
            "no terminal to ask for decisions",
            where="mutator review walk",
            remedy="use `mutator review approve GROUP... --by NAME`, or `reject`",
        )
    by, reviewed = name_reviewer(), load_groups()
    waiting = list(enumerate(reviewed.undecided, start=1))
    count = len(waiting)
    while waiting:
        number, group = waiting.pop(0)
        review_group_printing.print_group(terminal, reviewed.review, group)
        key = _ask_for_key(terminal, f"{number} of {count}")
        if key == "q":
            break
        if key == "s":
            continue
        words = typer.prompt(
            f"{'remark' if key == 'a' else 'reason'} (Enter: none)", default="", show_default=False
        )
        try:
            if key == "a":
                reviewed = reviewed.approve([group], by, words)
            else:
                reviewed = reviewed.reject([group], by, reason=words)
        except MutatorError as error:
            show_error(error)
            reviewed = reviewed.reread()
            waiting.insert(0, (number, group))  # shown again, with what the other reviewer decided
            continue
        style = review_group_printing.STYLE_BY_STATE[reviewed.review.state(group).value]
        terminal.print_text(f"{group.id} {reviewed.review.describe_decision(group)}", style=style)
    review = reviewed.review
    terminal.print_text(
        f"{short_path(review.path)}: {review_group_printing.describe_counts(review, reviewed.groups)}"
    )


def _ask_for_key(terminal: Terminal, position: str) -> str:
    choices = "  ".join(f"[{key}] {word}" for key, word in ACTION_BY_KEY.items())
    while True:
        terminal.print_text(f"{position}:  {choices}", style="bold")
        try:
            key = typer.getchar().lower()
        except EOFError:  # Ctrl-D
            return "q"
        if key in ACTION_BY_KEY:
            return key
