"""`stpa`: print the hazard analysis as tables, check it, and draw its control structure."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli.shared_options import Json, Manifest, Wide, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal, error_text, short_path
from mutator.errors import EXIT_CHECK_FAILED, MutatorError

if TYPE_CHECKING:
    from mutator.stpa.context_tables import ContextTable
    from mutator.stpa.hazard_analysis_yaml import HazardAnalysis

EXAMPLES = """\b
Examples:
  mutator stpa                       the analysis, its gaps and contradictions
  mutator stpa --svg structure.svg   also a diagram of its control structure
  mutator stpa --json                the analysis as JSON
"""


def register(app: typer.Typer) -> None:
    app.command("stpa", epilog=EXAMPLES)(stpa)


@with_workspace_options
def stpa(
    manifest: Manifest = None,
    svg: Annotated[
        Path | None, typer.Option("--svg", metavar="FILE", help="Write a diagram of the control structure.")
    ] = None,
    wide: Wide = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Print and check the hazard analysis.

    Prints each gap or contradiction with its file and line; the exit code is then 1.
    """
    terminal = Terminal(as_json, wide)
    workspace = workspace_options.workspace()
    problems = mutator.check_hazard_analysis(workspace, target=manifest)
    analysis = workspace.analysis()
    assert analysis is not None  # the check above fails without an analysis
    if svg:
        _write_text(svg, mutator.draw_control_structure(workspace))
    if as_json:
        problem_facts = [{"file": p.where, "line": p.line, "problem": str(p)} for p in problems]
        terminal.print_json(_analysis_as_json(analysis) | {"problems": problem_facts})
    _print_analysis(terminal, analysis)
    if svg:
        terminal.print_text(f"control structure: {short_path(svg)}")
    for problem in problems:
        terminal.print_text(error_text(problem), style="red", without_folding=not terminal.out.is_terminal)
    if problems:
        terminal.print_text(counted(len(problems), "problem"), style="bold red")
        raise typer.Exit(EXIT_CHECK_FAILED)
    faults = {fault for factor in analysis.factors_by_id.values() for fault in factor.faults}
    terminal.print_text(
        f"all well: {counted(len(analysis.factors_by_id), 'causal factor')}, "
        f"{counted(len(faults), 'fault spec')}, no gap, no contradiction",
        style="green",
    )


def _write_text(path: Path, text: str) -> None:
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as e:
        raise MutatorError(
            f"cannot write the file ({e.strerror})", where=path, remedy="choose another file"
        ) from None


def _print_analysis(terminal: Terminal, analysis: "HazardAnalysis") -> None:
    hazards = analysis.hazards
    _print_section(terminal, "accidents", ["id", "about"], hazards.accidents.items())
    rows: Iterable[tuple[str, ...]] = (
        (name, ", ".join(hazards.accidents_by_hazard[name]), about) for name, about in hazards.hazards.items()
    )
    _print_section(terminal, "hazards", ["id", "leads to", "about"], rows)
    _print_structure(terminal, analysis)
    for table in analysis.context_tables.values():
        _print_context_table(terminal, table)
    rows = (
        (name, a.action, a.category.value, ", ".join(a.hazards), _context_ids(a.contexts), a.about)
        for name, a in analysis.unsafe_actions.items()
    )
    heads = ["id", "action", "unsafe when", "hazards", "contexts", "about"]
    _print_section(terminal, "unsafe control actions", heads, rows)
    rows = (
        (name, ", ".join(f.where), ", ".join(f.leads_to), f.about)
        for name, f in analysis.factors_by_id.items()
    )
    _print_section(terminal, "causal factors", ["id", "where", "leads to", "about"], rows)
    rows = (
        (name, ", ".join(f.at), ", ".join(f.faults) or f"none: {f.no_fault}")
        for name, f in analysis.factors_by_id.items()
    )
    _print_section(
        terminal, "places and faults of the causal factors", ["id", "in the target", "faults"], rows
    )


def _print_structure(terminal: Terminal, analysis: "HazardAnalysis") -> None:
    structure = analysis.structure
    rows: Iterable[tuple[str, ...]] = (
        (name, component.kind.value, ", ".join(component.process_model), component.about)
        for name, component in structure.components.items()
    )
    _print_section(terminal, "control structure", ["component", "kind", "process model", "about"], rows)
    rows = (
        (
            name,
            structure.links[action.link].from_,
            structure.links[action.link].to,
            action.channel,
            action.about,
        )
        for name, action in structure.control_actions.items()
    )
    _print_section(terminal, "control actions", ["action", "from", "to", "channel", "about"], rows)
    actions = {action.link for action in structure.control_actions.values()}
    rows = (
        (name, link.from_, link.to, link.label)
        for name, link in structure.links.items()
        if name not in actions
    )
    _print_section(terminal, "feedback and other links", ["link", "from", "to", "carries"], rows)


def _print_context_table(terminal: Terminal, table: "ContextTable") -> None:
    actions = list(table.rows[0].hazards_by_action)
    heads = ["context", "trigger"]
    heads += [head for action in actions for head in (f"{action}", f"no {action}")] + ["about"]
    rows = []
    for row in table.rows:
        cells = [
            verdict
            for a in actions
            for verdict in (row.hazards_by_action[a].provided, row.hazards_by_action[a].not_provided)
        ]
        rows.append((row.id, row.condition, *(cell or "-" for cell in cells), row.about))
    _print_section(terminal, f"contexts of {table.name}", heads, rows, closing_text=_describe_coverage(table))


def _describe_coverage(table: "ContextTable") -> str:
    coverage = table.coverage
    if coverage.no_proof_reason:
        return f"cannot prove that the contexts cover everything exactly once: {coverage.no_proof_reason}"
    return f"the contexts cover everything exactly once: proved in {coverage.cell_count} cells"


def _context_ids(names: list[str]) -> str:
    return ", ".join(name.partition("/")[2] for name in names)


def _print_section(
    terminal: Terminal, title: str, heads: list[str], rows: Iterable[tuple[str, ...]], closing_text: str = ""
) -> None:
    cells = [tuple(" ".join(cell.split()) for cell in row) for row in rows]
    terminal.print_text(f"{title} ({len(cells)})", style="bold")
    terminal.print_table(heads, cells)
    if closing_text:
        terminal.print_text(closing_text)
    terminal.print_text()


def _analysis_as_json(analysis: "HazardAnalysis") -> dict[str, Any]:
    hazards = analysis.hazards
    return {
        "accidents": hazards.accidents,
        "hazards": {
            name: {"about": about, "leads_to": hazards.accidents_by_hazard[name]}
            for name, about in hazards.hazards.items()
        },
        "control_structure": analysis.structure.model_dump(mode="json", by_alias=True),
        "context_tables": {
            table.name: {
                "coverage": {"cells": table.coverage.cell_count, "beyond": table.coverage.no_proof_reason},
                "contexts": table.rows,
            }
            for table in analysis.context_tables.values()
        },
        "unsafe_control_actions": _models_as_json(analysis.unsafe_actions),
        "causal_factors": _models_as_json(analysis.factors_by_id),
    }


def _models_as_json(models: Any) -> dict[str, Any]:
    return {name: model.model_dump(mode="json") for name, model in models.items()}
