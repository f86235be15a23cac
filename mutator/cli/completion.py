"""Shell completion of names in the library, run folders and experiment ids. Completion reads few files, so it
is fast.
"""

import csv
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import typer

from mutator._common.doors import EXPORTS
from mutator._common.folder_search import library_folder, library_yaml_files, run_folders
from mutator.errors import MutatorError

Completer = Callable[[typer.Context, str], list[str]]


def build_completer(folder: str) -> Completer:
    """Return a completer for the library's files in this folder."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            return _names_starting(library_yaml_files(_library_folder(ctx), folder), incomplete)
        except MutatorError:  # a library that no command would use
            return []

    return complete


campaigns = build_completer("campaigns")
scenarios = build_completer("scenarios")
specs = build_completer("faults")
targets = build_completer("targets")


def runs(ctx: typer.Context, incomplete: str) -> list[str]:
    return _names_starting(map(_relative_to_here, run_folders(_library_folder(ctx).parent)), incomplete)


def formats(ctx: typer.Context, incomplete: str) -> list[str]:
    return _names_starting(EXPORTS.names(), incomplete)


def experiments(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete the experiment ids of the named run, or of the newest one."""
    folders = [Path(run)] if (run := ctx.params.get("run")) else run_folders(_library_folder(ctx).parent)[:1]
    return [name for folder in folders for name in _names_starting(_experiment_ids(folder), incomplete)]


def specs_and_experiments(ctx: typer.Context, incomplete: str) -> list[str]:
    return specs(ctx, incomplete) + experiments(ctx, incomplete)


def _library_folder(ctx: typer.Context) -> Path:
    path_by_option: dict[str, Any] = {}
    # options can stand before and after the subcommand; the later ones win
    for context in (ctx.find_root(), ctx):
        path_by_option |= {
            name: context.params.get(name) for name in ("root", "library") if context.params.get(name)
        }
    try:
        return library_folder(**path_by_option)
    except MutatorError:  # the shipped library cannot be unpacked
        return Path("fault_library")


def _experiment_ids(run: Path) -> list[str]:
    # plan.csv instead of the frozen plan, because the command line reads run folders only through the
    # API, whose import would delay every completion
    try:
        with (run / "plan.csv").open(encoding="utf-8", newline="") as file:
            return [line["experiment_id"] for line in csv.DictReader(file)]
    except (OSError, KeyError, UnicodeDecodeError):
        return []


def _names_starting(names: Iterable[str], incomplete: str) -> list[str]:
    return sorted(name for name in names if name.startswith(incomplete))


def _relative_to_here(path: Path) -> str:
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
