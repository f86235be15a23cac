"""`list`, `check`, `doctor`: show the library, check it against the target, check the machine."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli import shell_completion
from mutator.cli.shared_options import Json, Manifest, Wide, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal, error_text, short_path, with_option_names
from mutator.errors import EXIT_CHECK_FAILED, MutatorError

if TYPE_CHECKING:
    from mutator.checks.check_findings import Finding
    from mutator.workspace import Workspace


class EntryKind(StrEnum):
    """The kinds of entries that `list` shows."""

    SPECS = "specs"
    SCENARIOS = "scenarios"
    FAMILIES = "families"
    CAMPAIGNS = "campaigns"
    MODELS = "models"
    TRIGGERS = "triggers"
    DEFENCES = "defences"
    TARGETS = "targets"


KIND_NAMES = ", ".join(EntryKind)
ColumnsAndRows = tuple[list[str], list[dict[str, Any]]]


def register(app: typer.Typer) -> None:
    app.command("list", epilog=LIST_EXAMPLES)(list_library)
    app.command("check", epilog=CHECK_EXAMPLES)(check)
    app.command("doctor")(doctor)


LIST_EXAMPLES = """\b
Examples:
  mutator list              everything
  mutator list specs        the fault specs, with the number of faults in each
  mutator list --json       everything as JSON
"""


@with_workspace_options
def list_library(
    kind: Annotated[
        EntryKind | None, typer.Argument(metavar="KIND", help=f"Only this kind: {KIND_NAMES}. Default: all.")
    ] = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """List specs, scenarios, families, campaigns, models, triggers, defences, targets."""
    terminal = Terminal(as_json, wide)
    workspace = workspace_options.workspace()
    tables = {k.value: LIST_BY_KIND[k](workspace) for k in ([kind] if kind else list(EntryKind))}
    if as_json:
        terminal.print_json({name: rows for name, (_, rows) in tables.items()})
    for name, (columns, rows) in tables.items():
        numbers = [i for i, c in enumerate(columns) if all(isinstance(r[c], int) for r in rows)]
        terminal.print_text(f"{name} ({len(rows)})", style="bold")
        if rows:
            terminal.print_table(
                columns,
                [[r[c] for c in columns] for r in rows],
                right_aligned=numbers,
                priorities=[i for i, column in enumerate(columns) if column != "file"],
            )
        terminal.print_text()


def _list_specs(workspace: "Workspace") -> ColumnsAndRows:
    rows = [
        {"name": s.name, "faults": s.fault_count, "about": _as_one_line(s.about)} for s in workspace.specs()
    ]
    return ["name", "faults", "about"], rows


def _list_scenarios(workspace: "Workspace") -> ColumnsAndRows:
    return _list_files(workspace.scenarios, "title")


def _list_families(workspace: "Workspace") -> ColumnsAndRows:
    rows: list[dict[str, Any]] = []
    for name in workspace.families:
        family = workspace.family(name)
        parameters = "; ".join(f"{p.name}: {p.describe_values()}" for p in family.parameters)
        rows.append(
            {
                "name": name,
                "scenarios": math.prod(len(p.values) for p in family.parameters),
                "parameters": parameters,
                "title": _as_one_line(family.title),
            }
        )
    return ["name", "scenarios", "parameters", "title"], rows


def _list_campaigns(workspace: "Workspace") -> ColumnsAndRows:
    return _list_files(workspace.campaigns, "about")


def _list_files(files: Mapping[str, Path], about_key: str) -> ColumnsAndRows:
    from mutator.config.yaml_files import load_yaml

    rows: list[dict[str, Any]] = []
    for name, path in files.items():
        data = load_yaml(path).data
        about = data.get(about_key, "") if isinstance(data, dict) else ""
        rows.append({"name": name, "file": short_path(path), "about": _as_one_line(str(about))})
    return ["name", "file", "about"], rows


def _list_fault_models(workspace: "Workspace") -> ColumnsAndRows:
    rows = [
        {
            "name": m.name,
            "kind": m.kind.value,
            "parameters": ", ".join(p.name + ("?" if p.optional else "") for p in m.params),
            "about": _as_one_line(m.about),
        }
        for m in workspace.fault_models()
    ]
    return ["name", "kind", "parameters", "about"], rows


def _list_triggers(workspace: "Workspace") -> ColumnsAndRows:
    rows = [
        {"table": table.name, "name": row.id, "condition": row.condition, "about": _as_one_line(row.about)}
        for table in map(workspace.context_table, workspace.context_tables)
        for row in table.rows
    ]
    return ["table", "name", "condition", "about"], rows


def _list_defences(workspace: "Workspace") -> ColumnsAndRows:
    rows = [
        {
            "name": defence.name,
            "role": defence.role.value,
            "kind": defence.kind.value,
            "model": defence.model,
            "about": _as_one_line(defence.about),
        }
        for defence in map(workspace.defence, workspace.defences)
    ]
    return ["name", "role", "kind", "model", "about"], rows


def _list_targets(workspace: "Workspace") -> ColumnsAndRows:
    rows = []
    for name in workspace.targets:
        manifest = workspace.manifest(name)
        row = {"name": name, "root": short_path(manifest.root), "packages": ", ".join(manifest.packages)}
        rows.append(row | {"files": len(manifest.tree.files)})
    return ["name", "root", "packages", "files"], rows


LIST_BY_KIND: dict[EntryKind, Callable[["Workspace"], ColumnsAndRows]] = {
    EntryKind.SPECS: _list_specs,
    EntryKind.SCENARIOS: _list_scenarios,
    EntryKind.FAMILIES: _list_families,
    EntryKind.CAMPAIGNS: _list_campaigns,
    EntryKind.MODELS: _list_fault_models,
    EntryKind.TRIGGERS: _list_triggers,
    EntryKind.DEFENCES: _list_defences,
    EntryKind.TARGETS: _list_targets,
}

CHECK_EXAMPLES = """\b
Examples:
  mutator check                             library and templates against the target
  mutator check --drive                     also golden runs
  mutator check --drive --scenario S1       only the golden run of this scenario
  mutator --target ~/openpilot check        the same library against another source tree
"""
STYLE_BY_CHECK_STATE = {"ok": "green", "warning": "yellow", "failed": "red"}


@with_workspace_options
def check(
    manifest: Manifest = None,
    drive: Annotated[
        bool,
        typer.Option(
            "--drive", help="Also make golden runs, and check how they end and that they are deterministic."
        ),
    ] = False,
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            help="With --drive: only this scenario; repeatable. Default: the scenarios of the campaigns.",
            autocompletion=shell_completion.complete_scenarios,
        ),
    ] = None,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Check the library, templates and anchors against the target.

    Prints each problem with its file and line. If there is none, lists what prevents the target or its faults
    from running on the fork engines, entries of `draw` that no injection uses, and observed values that no
    channel records. The exit code is 1 if there is a problem, or if a golden run or canary would stop a
    campaign from starting.
    """
    terminal = Terminal(as_json)
    if scenario and not drive:
        raise MutatorError("scenarios without --drive", argument="scenario", remedy="add --drive")
    workspace = workspace_options.workspace()
    with terminal.show_spinner("checking every spec"):
        problems = mutator.check_library(workspace, target=manifest)
    findings: list[Finding] = []
    if not problems:
        with terminal.show_spinner("making golden runs" if drive else "loading the target"):
            findings = mutator.check_target(workspace, target=manifest, drive=drive, scenarios=scenario or ())
    if as_json:
        problem_facts = [{"file": p.where, "line": p.line, "problem": str(p)} for p in problems]
        terminal.print_json({"problems": problem_facts, "findings": findings})
    for problem in problems:
        terminal.print_text(error_text(problem), style="red", without_folding=not terminal.out.is_terminal)
    for finding in findings:
        # without --drive, passed checks are not news
        if drive or finding.level != "ok":
            _print_finding(terminal, finding)
    failed = [finding for finding in findings if finding.level == "failed"]
    if problems or failed:
        terminal.print_text(counted(len(problems) + len(failed), "problem"), style="bold red")
        raise typer.Exit(EXIT_CHECK_FAILED)
    faults = sum(spec.fault_count for spec in workspace.specs())
    readings_note = {1: "", 2: ", in both readings"}.get(
        number := len(workspace.readings().names), f", in all {number} readings"
    )
    warning_count = sum(finding.level == "warning" for finding in findings)
    verdict = f"no problem, {counted(warning_count, 'warning')}" if warning_count else "all well"
    specs = counted(len(workspace.spec_files()), "spec")
    terminal.print_text(f"{verdict}: {specs}, {counted(faults, 'fault')}{readings_note}", style="green")


def _print_finding(terminal: Terminal, finding: "Finding") -> None:
    terminal.print_text(f"{finding.name}: {finding.found}", style=STYLE_BY_CHECK_STATE[finding.level])
    for finding_place in finding.places:
        file = (
            short_path(Path(finding_place.file))
            if Path(finding_place.file).is_absolute()
            else finding_place.file
        )
        terminal.print_text(f"  {replace(finding_place, file=str(file))}")
    if finding.remedy:
        terminal.print_text(f"  to do: {finding.remedy}")


def _as_one_line(text: str) -> str:
    return " ".join(text.split())


@with_workspace_options
def doctor(as_json: Json = False, wide: Wide = False, *, workspace_options: WorkspaceOptions) -> None:
    """Check whether this machine can run campaigns.

    Checks the interpreter, packages, machine, library and target. The exit code is 1 if a campaign could not
    run.
    """
    terminal = Terminal(as_json, wide)
    with terminal.show_spinner("checking"):
        try:
            findings = mutator.doctor(workspace_options.workspace())
        except MutatorError as e:
            findings = mutator.doctor(with_option_names(e))
    if as_json:
        terminal.print_json(findings)
    terminal.print_table(
        ["what", "state", "found", "to do"],
        [(f.name, f.level.value, f.found, f.remedy) for f in findings],
        priorities=(0, 1, 3),
    )
    failed = [f.name for f in findings if f.level == "failed"]
    if failed:
        terminal.print_text(f"not ready: {', '.join(failed)}", style="bold red")
        raise typer.Exit(EXIT_CHECK_FAILED)
    terminal.print_text("ready", style="green")
