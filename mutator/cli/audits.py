"""`verify`: audit a run folder."""

from dataclasses import asdict
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
    rerun: Annotated[int, typer.Option(metavar="N", min=0, help="Rerun N randomly drawn experiments.")] = 0,
    expect: Annotated[
        str | None, typer.Option(metavar="DIGEST", help="The expected seal or results digest, 64 hex digits.")
    ] = None,
    expect_review: Annotated[
        str | None, typer.Option(metavar="DIGEST", help="The expected review digest, 64 hex digits.")
    ] = None,
    repair: Annotated[
        bool,
        typer.Option(
            "--repair", help="Set damaged parts aside; `run` with the same folder then redoes them."
        ),
    ] = False,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Audit a run folder and print the result on one page.

    The exit code is 1 if anything was changed or does not follow from the plan and the sources.
    """
    terminal = Terminal(as_json)
    with terminal.wait("verifying"):
        audit = mutator.verify(
            run,
            rerun=rerun,
            expect=expect,
            expect_review=expect_review,
            repair=repair,
            workspace=library_if_any(place),
        )
    if as_json:
        checks = [
            {"what": c.what, "count": c.count, "differences": [error_text(d) for d in c.differences]}
            for c in audit.checks
        ]
        facts = {"run": str(run), "passed": audit.passed, **asdict(audit.seals), "facts": audit.facts}
        terminal.emit(facts | {"not_sealed": audit.not_sealed, "checks": checks, "repaired": audit.repaired})
    terminal.say(str(audit))
    if not audit.passed:
        raise typer.Exit(EXIT_CHECK_FAILED)
