"""`list`, `check`, `doctor`: show the library, check it against the target, check the machine."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli import completion
from mutator.cli.console import Terminal, error_text, short_path, with_options
from mutator.cli.options import Json, Manifest, Place, with_place
from mutator.errors import EXIT_CHECK_FAILED, MutatorError

if TYPE_CHECKING:
    from mutator.checks.findings import Finding
    from mutator.workspace import Workspace


class Kind(StrEnum):
    """The kinds of entries that `list` shows."""

    SPECS = "specs"
    SCENARIOS = "scenarios"
    CAMPAIGNS = "campaigns"
    MODELS = "models"
    TRIGGERS = "triggers"
    TARGETS = "targets"


Table = tuple[list[str], list[dict[str, Any]]]


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


@with_place
def list_library(
    kind: Annotated[Kind | None, typer.Argument(help="Only this kind. Default: all.")] = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """List specs, scenarios, campaigns, models, triggers, targets."""
    terminal = Terminal(as_json)
    workspace = place.workspace()
    tables = {k.value: LISTS[k](workspace) for k in ([kind] if kind else list(Kind))}
    if as_json:
        terminal.emit({name: rows for name, (_, rows) in tables.items()})
    for name, (columns, rows) in tables.items():
        numbers = [i for i, c in enumerate(columns) if all(isinstance(r[c], int) for r in rows)]
        terminal.say(f"{name} ({len(rows)})", style="bold")
        if rows:
            terminal.table(columns, [[r[c] for c in columns] for r in rows], right=numbers)
        terminal.say()


def _specs(workspace: "Workspace") -> Table:
    rows = [{"name": s.name, "faults": s.count, "about": _line(s.about)} for s in workspace.specs()]
    return ["name", "faults", "about"], rows


def _scenarios(workspace: "Workspace") -> Table:
    return _files(workspace.scenarios, "title")


def _campaigns(workspace: "Workspace") -> Table:
    return _files(workspace.campaigns, "about")


def _files(files: Mapping[str, Path], key: str) -> Table:
    from mutator.config.yaml_files import load_yaml

    rows: list[dict[str, Any]] = []
    for name, path in files.items():
        data = load_yaml(path).data
        about = data.get(key, "") if isinstance(data, dict) else ""
        rows.append({"name": name, "file": short_path(path), "about": _line(str(about))})
    return ["name", "file", "about"], rows


def _models(workspace: "Workspace") -> Table:
    rows = [
        {
            "name": m.name,
            "kind": m.kind.value,
            "parameters": ", ".join(p.name + ("?" if p.optional else "") for p in m.params),
            "about": _line(m.about),
        }
        for m in workspace.fault_models()
    ]
    return ["name", "kind", "parameters", "about"], rows


def _triggers(workspace: "Workspace") -> Table:
    rows = [
        {"table": table.name, "name": row.id, "condition": row.condition, "about": _line(row.about)}
        for table in map(workspace.context_table, workspace.context_tables)
        for row in table.rows
    ]
    return ["table", "name", "condition", "about"], rows


def _targets(workspace: "Workspace") -> Table:
    rows = []
    for name in workspace.targets:
        manifest = workspace.manifest(name)
        row = {"name": name, "root": short_path(manifest.root), "packages": ", ".join(manifest.packages)}
        rows.append(row | {"files": len(manifest.tree.files)})
    return ["name", "root", "packages", "files"], rows


LISTS: dict[Kind, Callable[["Workspace"], Table]] = {
    Kind.SPECS: _specs,
    Kind.SCENARIOS: _scenarios,
    Kind.CAMPAIGNS: _campaigns,
    Kind.MODELS: _models,
    Kind.TRIGGERS: _triggers,
    Kind.TARGETS: _targets,
}

CHECK_EXAMPLES = """\b
Examples:
  mutator check                             library and templates against the target
  mutator check --drive                     also golden runs
  mutator check --drive --scenario S1       only the golden run of this scenario
  mutator --target ~/openpilot check        the same library against another source tree
"""
LEVEL_STYLES = {"ok": "green", "warning": "yellow", "failed": "red"}


@with_place
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
            autocompletion=completion.scenarios,
        ),
    ] = None,
    as_json: Json = False,
    *,
    place: Place,
) -> None:
    """Check the library, templates and anchors against the target.

    Prints each problem with its file and line. If there is none, lists what prevents the target or its faults
    from running on the fork engines, and entries of `draw` that no injection uses. The exit code is 1 if
    there is a problem, or if a golden run or canary would stop a campaign from starting.
    """
    terminal = Terminal(as_json)
    if scenario and not drive:
        raise MutatorError("scenarios without --drive", argument="scenario", remedy="add --drive")
    workspace = place.workspace()
    with terminal.wait("checking every spec in every reading"):
        problems = mutator.check_library(workspace, target=manifest)
    findings: list[Finding] = []
    if not problems:
        with terminal.wait("making golden runs" if drive else "loading the target"):
            findings = mutator.check_target(workspace, target=manifest, drive=drive, scenarios=scenario or ())
    if as_json:
        told = [{"file": p.where, "line": p.line, "problem": str(p)} for p in problems]
        terminal.emit({"problems": told, "findings": findings})
    for problem in problems:
        terminal.say(error_text(problem), style="red", whole=not terminal.out.is_terminal)
    for finding in findings:
        if drive or finding.level != "ok":
            _say_finding(terminal, finding)
    failed = [finding for finding in findings if finding.level == "failed"]
    if problems or failed:
        terminal.say(counted(len(problems) + len(failed), "problem"), style="bold red")
        raise typer.Exit(EXIT_CHECK_FAILED)
    faults = sum(spec.count for spec in workspace.specs())
    readings = {1: "", 2: ", in both readings"}.get(
        number := len(workspace.readings().names), f", in all {number} readings"
    )
    warned = sum(finding.level == "warning" for finding in findings)
    well = f"no problem, {counted(warned, 'warning')}" if warned else "all well"
    specs = counted(len(workspace.spec_files()), "spec")
    terminal.say(f"{well}: {specs}, {counted(faults, 'fault')}{readings}", style="green")


def _say_finding(terminal: Terminal, finding: "Finding") -> None:
    terminal.say(f"{finding.name}: {finding.found}", style=LEVEL_STYLES[finding.level])
    for one in finding.places:
        file = short_path(Path(one.file)) if Path(one.file).is_absolute() else one.file
        terminal.say(f"  {replace(one, file=str(file))}")
    if finding.remedy:
        terminal.say(f"  to do: {finding.remedy}")


def _line(text: str) -> str:
    return " ".join(text.split())


@with_place
def doctor(as_json: Json = False, *, place: Place) -> None:
    """Check whether this machine can run campaigns.

    Checks the interpreter, packages, machine, library and target. The exit code is 1 if a campaign could not
    run.
    """
    terminal = Terminal(as_json)
    with terminal.wait("checking"):
        try:
            findings = mutator.doctor(place.workspace())
        except MutatorError as e:
            findings = mutator.doctor(with_options(e))
    if as_json:
        terminal.emit(findings)
    terminal.table(
        ["what", "state", "found", "to do"], [(f.name, f.level.value, f.found, f.remedy) for f in findings]
    )
    bad = [f.name for f in findings if f.level == "failed"]
    if bad:
        terminal.say(f"not ready: {', '.join(bad)}", style="bold red")
        raise typer.Exit(EXIT_CHECK_FAILED)
    terminal.say("ready", style="green")
