"""`init`: a library and templates of one's own."""

from pathlib import Path
from typing import Annotated

import typer

import mutator
from mutator.cli.console import Terminal, short_path
from mutator.cli.options import Json

INIT_EXAMPLES = """\b
Examples:
  mutator init faults        a copy to edit, in faults/; its README has the first commands
"""


def register(app: typer.Typer) -> None:
    """Add the verb to the command line."""
    app.command("init", epilog=INIT_EXAMPLES)(init)


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new or empty folder.")],
    as_json: Json = False,
) -> None:
    """Write a fault library and templates to edit.

    They are copies of what ships with mutator, with a README. In DIR and below, mutator uses them; the
    controller under test stays the one that ships, unless the manifest in DIR or --target names another.
    """
    terminal = Terminal(as_json)
    mutator.init_library(folder)
    if as_json:
        terminal.emit({"folder": str(folder)})
    terminal.say(f"{short_path(folder)}: fault_library/, templates/ and a README.md that says how to go on")
