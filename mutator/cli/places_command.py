"""`places`: list where in a file faults can be injected, and with which models."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from mutator._common.message_text import counted
from mutator.cli.shared_options import Json, Manifest, Wide, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal

if TYPE_CHECKING:
    from mutator.mutants.possible_places import ListedPlace

EXAMPLES = """\b
Examples:
  mutator places pkg/sensor.py                      every place in the file
  mutator places pkg/sensor.py::Sensor.measure      only those in one function
  mutator places pkg/sensor.py --json               the same as JSON
"""


def register(app: typer.Typer) -> None:
    app.command("places", epilog=EXAMPLES)(list_places)


@with_workspace_options
def list_places(
    where: Annotated[
        str, typer.Argument(metavar="FILE[::FUNCTION]", help="A file of the target, or one function in it.")
    ],
    manifest: Manifest = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """List where faults can be injected, and with which models.

    Each line shows an anchor as you write it under `at` in a spec: a statement, a value changed in place, a
    constant, or a default.
    """
    from mutator.api.target_places import places_and_notes

    terminal = Terminal(as_json, wide)
    places, notes = places_and_notes(where, workspace_options.workspace(), manifest)
    if as_json:
        terminal.print_json(
            [{"line": place.line, "at": place.at, "models": place.models} for place in places]
        )
        return
    _print_places(terminal, places)
    for note in notes:
        terminal.print_text(f"line {note.line}, {note.what}: {note.reason}")


def _print_places(terminal: Terminal, places: Sequence["ListedPlace"]) -> None:
    letters: dict[tuple[str, ...], str] = {}
    rows = []
    for place in places:
        letter = letters.setdefault(place.models, _letters_of(len(letters)))
        rows.append([place.line, letter, _anchor_as_yaml(place.at)])
    terminal.print_table(["line", "models", "at"], rows, right_aligned=[0], last_is_whole=True)
    terminal.print_text()
    for models, letter in letters.items():
        terminal.print_text(f"{letter}: {', '.join(models)}")
    lines = {place.line for place in places}
    terminal.print_text(f"{counted(len(places), 'place')} on {counted(len(lines), 'line')}")


def _letters_of(number: int) -> str:
    """Return A, B, ..., Z, AA, AB, ... for 0, 1, ..."""
    tens, ones = divmod(number, 26)
    return (_letters_of(tens - 1) if tens else "") + chr(ord("A") + ones)


def _anchor_as_yaml(at: Mapping[str, Any]) -> str:
    anchor = {key: value for key, value in at.items() if key != "file"}
    import yaml

    line = yaml.safe_dump(
        # a place fills one line, however long
        anchor,
        default_flow_style=True,
        sort_keys=False,
        width=math.inf,
        allow_unicode=True,
    )
    return str(line).strip()
