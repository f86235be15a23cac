"""`import`: make a library of the fault files of others."""

from collections.abc import Iterable
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import typer

import mutator
from mutator._common.extension_doors import LIBRARY_IMPORTER_DOOR
from mutator._common.message_text import counted
from mutator.cli.shared_options import Json
from mutator.cli.terminal_output import Terminal, short_path, with_option_names
from mutator.errors import MutatorError

EXAMPLES = """\b
Examples:
  mutator import uva OpenpilotWithVision --out authors      the fault files of the paper's authors
  cd authors && mutator run uva_always --out runs/always    run the faults of one of their conditions
"""


def register(app: typer.Typer) -> None:
    app.command("import", epilog=EXAMPLES)(import_faults)


def import_faults(
    format_name: Annotated[
        str,
        typer.Argument(
            metavar="FORMAT",
            help=f"{', '.join(LIBRARY_IMPORTER_DOOR.shipped_names())}, or one that another package adds.",
        ),
    ],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder with the files.")],
    out: Annotated[
        Path, typer.Option("--out", metavar="LIBRARY", help="A new or empty folder for the library.")
    ],
    as_json: Json = False,
) -> None:
    """Import fault files of others into a new library.

    The library is a copy of the one that ships with mutator, with specs and campaigns for the faults.
    Each line is imported, equal to a fault that the library has already, or refused with a reason;
    imported.csv lists them. The files are parsed and never executed.
    """
    terminal = Terminal(as_json)
    try:
        imported = mutator.import_library(format_name, folder, out)
    except MutatorError as error:
        raise with_option_names(error, {"format": "FORMAT", "folder": "--out"}) from None
    if as_json:
        terminal.print_json(_as_json(imported, out))
        return
    files = len({entry.file for entry in imported.entries})
    counts = ", ".join(f"{imported.count(outcome)} {outcome.value}" for outcome in mutator.EntryOutcome)
    terminal.print_text(
        f"{short_path(out)}: {counted(len(imported.entries), 'line')} in {counted(files, 'file')}: {counts}"
    )
    for text in _refusal_texts(imported.entries):
        terminal.print_text(f"refused: {text}")
    for name, reason in imported.ignored.items():
        terminal.print_text(f"not read: {name}: {reason}")
    campaigns = sorted({entry.campaign for entry in imported.entries if entry.campaign})
    terminal.print_text(f"campaigns: {', '.join(campaigns)}")
    terminal.print_text(f"{short_path(out / 'imported.csv')} says what became of each line")


def _refusal_texts(entries: "Iterable[mutator.ImportedEntry]") -> Iterable[str]:
    """Yield a text for the refused lines of a file that have the same reason."""
    refused = [entry for entry in entries if entry.reason]
    for (file, reason), group in groupby(refused, key=lambda entry: (entry.file, entry.reason)):
        lines = [entry.line for entry in group]
        numbers = f"{lines[0]}" if len(lines) == 1 else f"{lines[0]} to {lines[-1]} ({len(lines)} lines)"
        yield f"{file}:{numbers}: {reason}"


def _as_json(imported: "mutator.ImportedLibrary", out: Path) -> dict[str, Any]:
    names = mutator.ImportedEntry.__slots__
    return {
        "folder": str(out),
        "counts": {outcome.value: imported.count(outcome) for outcome in mutator.EntryOutcome},
        "ignored": dict(imported.ignored),
        "entries": [{name: getattr(entry, name) for name in names} for entry in imported.entries],
    }
