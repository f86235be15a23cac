"""`places`: list where in a file faults can be injected, and with which models."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli.console import Terminal
from mutator.cli.options import Json, Manifest, Place, with_place

if TYPE_CHECKING:
    from mutator.mutants.possible_places import ListedPlace

PLACES_EXAMPLES = """\b
Examples:
  mutator places pkg/sensor.py                      every place in the file
  mutator places pkg/sensor.py::Sensor.measure      only those in one function
  mutator places pkg/sensor.py --json               the same as JSON
"""


def register(app: typer.Typer) -> None:
    app.command("places", epilog=PLACES_EXAMPLES)(list_places)


@with_place
def list_places(
    where: Annotated[
        str, typer.Argument(metavar="FILE[::FUNCTION]", help="A file of the target, or one function in it.")
    ],
    manifest: Manifest = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """List where faults can be injected, and with which models.

    Each line shows an anchor as you write it under `at` in a spec: a statement, a value changed in place, a
    constant, or a default.
    """
    terminal = Terminal(as_json)
    found = mutator.find_places(where, place.workspace(), target=manifest)
    if as_json:
        terminal.emit([{"line": one.line, "at": one.at, "models": one.models} for one in found])
        return
    _print(terminal, found)


def _print(terminal: Terminal, found: Sequence["ListedPlace"]) -> None:
    letters: dict[tuple[str, ...], str] = {}
    rows = []
    for one in found:
        letter = letters.setdefault(one.models, _letter(len(letters)))
        rows.append([one.line, _yaml(one.at), letter])
    terminal.table(["line", "at", "models"], rows, right=[0])
    terminal.say()
    for models, letter in letters.items():
        terminal.say(f"{letter}: {', '.join(models)}")
    terminal.say(f"{counted(len(found), 'place')} on {counted(len({one.line for one in found}), 'line')}")


def _letter(number: int) -> str:
    """Return A, B, ..., Z, AA, AB, ... for 0, 1, ..."""
    tens, ones = divmod(number, 26)
    return (_letter(tens - 1) if tens else "") + chr(ord("A") + ones)


def _yaml(at: Mapping[str, Any]) -> str:
    told = {key: value for key, value in at.items() if key != "file"}
    import yaml

    line = yaml.safe_dump(told, default_flow_style=True, sort_keys=False, width=math.inf, allow_unicode=True)
    return str(line).strip()
