"""`review walk`: one group after the other, a key for each."""

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

import typer

from mutator.cli import review_view
from mutator.cli.console import Terminal, short_path
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.cli.review_choice import Loaded

KEYS = {"a": "approve", "r": "reject", "s": "skip", "q": "quit"}


def walk_through(terminal: Terminal, load: Callable[[], "Loaded"], by: str) -> None:
    """Show every group that is new or changed and do what is answered; each decision is kept at once.

    MutatorError, before anything is made, when there is nobody to answer.
    """
    from mutator.review.decisions import State, Verdict

    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise MutatorError(
            "no terminal to ask in",
            where="mutator review walk",
            remedy="decide by `mutator review approve GROUP... --by NAME`, or `reject`",
        )
    found = load()
    review = found.review
    left = [g for g in found.groups if review.state(g) in (State.NEW, State.CHANGED)]
    for number, group in enumerate(left, start=1):
        review_view.print_group(terminal, review, group)
        key = _asked(terminal, f"{number} of {len(left)}")
        if key == "q":
            break
        if key == "s":
            continue
        remark = typer.prompt("remark (Enter: none)", default="", show_default=False)
        verdict = Verdict.APPROVED if key == "a" else Verdict.REJECTED
        review = review.decided([group], verdict, by, remark)
        review.write()
        terminal.say(f"{group.id} {review.describe(group)}", style=review_view.STYLES[verdict.value])
    terminal.say(f"{short_path(review.path)}: {review_view.counts(review, found.groups)}")


def _asked(terminal: Terminal, where: str) -> str:
    """The key that was pressed, once it is one of ours."""
    choices = "  ".join(f"[{key}] {word}" for key, word in KEYS.items())
    while True:
        terminal.say(f"{where}:  {choices}", style="bold")
        try:
            key = typer.getchar().lower()
        except EOFError:  # Ctrl-D
            return "q"
        if key in KEYS:
            return key
