"""`init` and `upgrade`: a library of one's own, and its manifests in today's schema."""

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
    """Add the verbs to the command line."""
    app.command("init", epilog=INIT_EXAMPLES)(init)
    app.command("upgrade")(upgrade)


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


def upgrade(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A target's manifest.")],
    as_json: Json = False,
) -> None:
    """Write a manifest of an older schema in today's.

    Lines that mean the same in both stay as they are. Comments within those that change are printed, so that
    you can put them back.
    """
    terminal = Terminal(as_json)
    done = mutator.upgrade_manifest(file)
    if as_json:
        terminal.emit(
            {"file": str(file), "upgraded": done is not None, "lost": list(done.lost) if done else []}
        )
    if done is None:
        terminal.say(f"{short_path(file)}: nothing to do")
        return
    terminal.say(f"{short_path(file)}: now of today's schema")
    for comment in done.lost:
        terminal.say(f"  left out: {comment}")
