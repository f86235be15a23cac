"""Shell completion of names in the library, run folders and experiment ids. Completion reads few files, so it
is fast.
"""

import csv
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import typer

from mutator._common.doors import EXPORTS
from mutator._common.folder_search import library_files, library_folder, run_folders
from mutator.errors import MutatorError

Completer = Callable[[typer.Context, str], list[str]]


def names_in(folder: str) -> Completer:
    """Return a completer for the library's files in this folder."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            return _starting(library_files(_library(ctx), folder), incomplete)
        except MutatorError:  # a library that no command would use
            return []

    return complete


campaigns = names_in("campaigns")
scenarios = names_in("scenarios")
specs = names_in("faults")
targets = names_in("targets")


def runs(ctx: typer.Context, incomplete: str) -> list[str]:
    return _starting(map(_from_here, run_folders(_library(ctx).parent)), incomplete)


def formats(ctx: typer.Context, incomplete: str) -> list[str]:
    return _starting(EXPORTS.names(), incomplete)


def experiments(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete the experiment ids of the named run, or of the newest one."""
    folders = [Path(run)] if (run := ctx.params.get("run")) else run_folders(_library(ctx).parent)[:1]
    return [name for folder in folders for name in _starting(_ids(folder), incomplete)]


def specs_and_experiments(ctx: typer.Context, incomplete: str) -> list[str]:
    return specs(ctx, incomplete) + experiments(ctx, incomplete)


def _library(ctx: typer.Context) -> Path:
    given: dict[str, Any] = {}
    for one in (ctx.find_root(), ctx):
        given |= {name: one.params.get(name) for name in ("root", "library") if one.params.get(name)}
    try:
        return library_folder(**given)
    except MutatorError:  # the shipped library cannot be unpacked
        return Path("fault_library")


def _ids(run: Path) -> list[str]:
    # plan.csv instead of the frozen plan, because the command line reads run folders only through the
    # API, whose import would delay every completion
    try:
        with (run / "plan.csv").open(encoding="utf-8", newline="") as file:
            return [line["experiment_id"] for line in csv.DictReader(file)]
    except (OSError, KeyError, UnicodeDecodeError):
        return []


def _starting(names: Iterable[str], incomplete: str) -> list[str]:
    return sorted(name for name in names if name.startswith(incomplete))


def _from_here(path: Path) -> str:
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
