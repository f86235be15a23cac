"""`verify`: does a run folder hold what was found, and does it all follow?"""

from pathlib import Path
from typing import Annotated

import typer

import mutator
from mutator.cli import completion
from mutator.cli.console import Terminal, error_text
from mutator.cli.options import Json, Place, with_place
from mutator.cli.run_folders import library_if_any
from mutator.errors import EXIT_CHECK_FAILED


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("verify", epilog=EXAMPLES)(verify)


EXAMPLES = """\b
Examples:
  mutator verify runs/first
  mutator verify runs/first --rerun 5 --expect 3f9a...     (the seal that `mutator run` printed)
  mutator verify runs/first --repair
"""


@with_place
def verify(
    run: Annotated[Path, typer.Argument(metavar="DIR", help="A run folder.", autocompletion=completion.runs)],
    rerun: Annotated[
        int, typer.Option(metavar="N", min=0, help="Drive N experiments, drawn by lot, again.")
    ] = 0,
    expect: Annotated[
        str | None, typer.Option(metavar="SEAL", help="The seal that the run must have, 64 hex digits.")
    ] = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="Put what is damaged aside; the same `run` then fills the gap.")
    ] = False,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Audit a run folder, wherever it comes from: one page to keep.

    Exit code 1 if anything is not as it was written, or does not follow from plan and sources.
    """
    terminal = Terminal(as_json)
    with terminal.wait("verifying"):
        audit = mutator.verify(
            run, rerun=rerun, expect=expect, repair=repair, workspace=library_if_any(place)
        )
    if as_json:
        checks = [
            {"what": c.what, "count": c.count, "differences": [error_text(d) for d in c.differences]}
            for c in audit.checks
        ]
        facts = {"run": str(run), "passed": audit.passed, "seal": audit.seal, "facts": audit.facts}
        terminal.emit(facts | {"checks": checks, "repaired": audit.repaired})
    terminal.say(str(audit))
    if not audit.passed:
        raise typer.Exit(EXIT_CHECK_FAILED)
