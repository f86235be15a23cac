"""`export`: write a run for other tools."""

from pathlib import Path
from typing import Annotated

import typer

import mutator
from mutator.cli import shell_completion
from mutator.cli.merge_report_clean_commands import workspace_if_any
from mutator.cli.shared_options import Json, WorkspaceOptions, with_workspace_options
from mutator.cli.terminal_output import Terminal, short_path
from mutator.exports import ExportTable, Format, find_export


def register(app: typer.Typer) -> None:
    app.command("export", epilog=EXAMPLES)(export)


EXAMPLES = """\b
Examples:
  mutator export runs/first --format mutation-elements   for viewers of mutation testing reports
  mutator export runs/change --format sarif --base runs/main
  mutator export runs/first --format junit --out junit.xml
  mutator export runs/first --format junit --failures hazard,crashed
  mutator export runs/first --format parquet --out first.parquet
  mutator export runs/first --format csv --table propagation
  mutator export runs/first --format mcap --only 'outcome == "hazard"'
"""


@with_workspace_options
def export(
    run: Annotated[
        Path,
        typer.Argument(metavar="RUN", help="A run folder.", autocompletion=shell_completion.complete_runs),
    ],
    format: Annotated[
        str,
        typer.Option(
            metavar=f"[{'|'.join(Format)}]",
            help="What to write. Other packages can add formats.",
            autocompletion=shell_completion.complete_formats,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="FILE", help="Where to write. Default: a file or folder in RUN/exports/."
        ),
    ] = None,
    failures: Annotated[
        str | None,
        typer.Option(
            metavar="ENDING,...",
            help="JUnit: endings to report as failures: hazard, sdc, masked, crashed, timeout. "
            "Default: none.",
        ),
    ] = None,
    only: Annotated[
        str | None,
        typer.Option(
            metavar="EXPR",
            help="MCAP: only experiments whose result columns match, e.g. 'outcome == \"hazard\"'.",
            autocompletion=shell_completion.complete_result_columns,
        ),
    ] = None,
    table: Annotated[ExportTable, typer.Option(help="CSV and Parquet: which table.")] = ExportTable.RESULTS,
    base: Annotated[
        Path | None,
        typer.Option(
            metavar="RUN",
            help="SARIF and code quality: leave out the hazards of this earlier run.",
            autocompletion=shell_completion.complete_runs,
        ),
    ] = None,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Export a run: mutation report, SARIF, code quality, JUnit, CSV, Parquet, MCAP.

    SARIF (for code scanning) and code quality (for GitLab) list hazards at the places of their faults. MCAP
    writes one file for each experiment, with events, units, and separate topics for the golden and the faulty
    run.
    """
    terminal = Terminal(as_json)
    exporter = find_export(format)
    workspace = workspace_options.workspace() if exporter.needs_library else None
    if exporter.uses_library:
        workspace = workspace_if_any(workspace_options)
    endings = [name.strip() for name in failures.split(",")] if failures else []
    with terminal.show_spinner("writing"):
        out_path = mutator.load_run(run, workspace=workspace).export(
            format, out, failures=endings, only=only, table=table, base=base
        )
    if as_json:
        terminal.print_json({"format": format, "file": str(out_path)})
    terminal.print_text(f"{format}: {short_path(out_path)}")
