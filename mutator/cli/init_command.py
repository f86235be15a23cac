"""`init`: create a library."""

from pathlib import Path
from typing import Annotated, Any

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli.shared_options import Json
from mutator.cli.terminal_output import Terminal, short_path, with_option_names
from mutator.errors import MutatorError

EXAMPLES = """\b
Examples:
  mutator init faults                           a copy to edit; its README has the first commands
  mutator init faults --target ../controller    a first library for the controller in that folder
  mutator init faults --target installed:NAME   a first library for an installed package
  mutator init faults --target ../repo --in 'pkg/control/**'
                                                for a controller in a large repository
"""


def register(app: typer.Typer) -> None:
    app.command("init", epilog=EXAMPLES)(init)


def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A new or empty folder.")],
    tree: Annotated[
        str | None,
        typer.Option("--target", metavar="TREE", help="A controller's source: a folder, or installed:NAME."),
    ] = None,
    globs: Annotated[
        list[str] | None,
        typer.Option(
            "--in",
            metavar="GLOB",
            help="With --target: search only these files for the controller, relative to TREE (for "
            "installed:NAME, `NAME/...`). `**` spans folders. Repeatable.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write an editable fault library.

    With --target, writes a first library for that controller: manifest, entry, scenario, fault and campaign,
    with places to fill in. The controller's source is read, never run. Without --target, copies the library
    and templates that ship with mutator. In DIR and below, mutator uses the new library.
    """
    from mutator.api.libraries import unfilled_places

    terminal = Terminal(as_json)
    try:
        mutator.init_library(folder, target=tree, files=globs or ())
    except MutatorError as error:
        # elsewhere, `target` is --manifest
        raise with_option_names(error, {"folder": "DIR", "target": "--target", "files": "--in"}) from None
    facts: dict[str, Any] = {"folder": str(folder)}
    content = "fault_library/, templates/"
    if tree is not None:
        places = unfilled_places(folder)
        facts["unfilled"] = [{"file": place.where, "line": place.line} for place in places]
        content = f"fault_library/ with {counted(len(places), 'place')} to fill in,"
    if as_json:
        terminal.print_json(facts)
    terminal.print_text(f"{short_path(folder)}: {content} and a README.md with the next steps")
