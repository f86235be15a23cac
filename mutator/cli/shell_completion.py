"""Shell completion of names in the library, run folders and experiment ids. Completion reads few files, so it
is fast.
"""

import csv
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import typer

from mutator._common.extension_doors import EXPORT_DOOR
from mutator._common.library_and_run_folder_search import (
    library_folder,
    library_yaml_files,
    run_folders_newest_first,
)
from mutator.engines.engine_kinds import OFFERED_ENGINES
from mutator.errors import MutatorError

_LAST_NAME_PATTERN = re.compile(r"[A-Za-z_]\w*$|$")
Completer = Callable[[typer.Context, str], list[str]]


def build_completer(folder: str) -> Completer:
    """Return a completer for the library's files in this folder."""

    def complete(ctx: typer.Context, incomplete: str) -> list[str]:
        try:
            return _names_starting(library_yaml_files(_library_folder(ctx), folder), incomplete)
        except MutatorError:  # a library that no command would use
            return []

    return complete


complete_campaigns = build_completer("campaigns")
complete_scenarios = build_completer("scenarios")
complete_specs = build_completer("faults")


def complete_targets(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete the names in the manifests."""
    from mutator.targets.manifests_by_name import manifest_path_by_name

    try:
        names = manifest_path_by_name(library_yaml_files(_library_folder(ctx), "targets"))
    except MutatorError:  # a library that no command would use
        return []
    return _names_starting(names, incomplete)


def complete_runs(ctx: typer.Context, incomplete: str) -> list[str]:
    return _names_starting(
        map(_relative_to_here, run_folders_newest_first(_library_folder(ctx).parent)), incomplete
    )


def complete_formats(ctx: typer.Context, incomplete: str) -> list[str]:
    return _names_starting(EXPORT_DOOR.names(), incomplete)


def complete_engines(ctx: typer.Context, incomplete: str) -> list[str]:
    return _names_starting(OFFERED_ENGINES, incomplete)


def complete_triggers(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete the names of contexts. Times and conditions are the user's."""
    from mutator.config.yaml_files import load_yaml

    names = {"always"}
    try:
        for path in library_yaml_files(_library_folder(ctx), "stpa/contexts").values():
            data = load_yaml(path).data
            contexts = data.get("contexts") if isinstance(data, dict) else None
            names |= set(map(str, contexts)) if isinstance(contexts, dict) else set()
    except MutatorError:  # a file that every command refuses
        return []
    return _names_starting(names, incomplete)


def complete_gates(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete the last kind of a list with commas."""
    import mutator  # which loads its parts only as they are used

    before, comma, last = incomplete.rpartition(",")
    return [before + comma + name for name in _names_starting((gate.value for gate in mutator.Gate), last)]


def complete_plan_columns(ctx: typer.Context, incomplete: str) -> list[str]:
    from mutator.results.plan_columns import plan_column_names

    return _expressions_with_column(plan_column_names(), incomplete)


def complete_result_columns(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete a column of the results of the named run, or of the newest one."""
    return [
        text
        for folder in _run_folders(ctx)
        for text in _expressions_with_column(_heads_of(folder / "results.csv"), incomplete)
    ]


def complete_group_columns(ctx: typer.Context, incomplete: str) -> list[str]:
    from mutator.review.group_filter_columns import GROUP_FILTER_COLUMNS

    return _expressions_with_column(GROUP_FILTER_COLUMNS, incomplete)


def complete_experiments(ctx: typer.Context, incomplete: str) -> list[str]:
    """Complete the experiment ids of the named run, or of the newest one."""
    return [
        name for folder in _run_folders(ctx) for name in _names_starting(_experiment_ids(folder), incomplete)
    ]


def complete_specs_and_experiments(ctx: typer.Context, incomplete: str) -> list[str]:
    return complete_specs(ctx, incomplete) + complete_experiments(ctx, incomplete)


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


def _run_folders(ctx: typer.Context) -> list[Path]:
    """Return the named run folder, or the newest one, if there is any."""
    run = ctx.params.get("run")
    return [Path(run)] if run else list(run_folders_newest_first(_library_folder(ctx).parent)[:1])


def _heads_of(table: Path) -> list[str]:
    try:
        with table.open(encoding="utf-8", newline="") as file:
            return next(csv.reader(file), [])
    except (OSError, UnicodeDecodeError):
        return []


def _expressions_with_column(columns: Iterable[str], incomplete: str) -> list[str]:
    """Complete the name at the end of an expression."""
    name = _LAST_NAME_PATTERN.search(incomplete)
    assert name is not None  # it also matches the empty end
    return [incomplete[: name.start()] + column for column in _names_starting(columns, name[0])]


def _names_starting(names: Iterable[str], incomplete: str) -> list[str]:
    return sorted(name for name in names if name.startswith(incomplete))


def _relative_to_here(path: Path) -> str:
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)
