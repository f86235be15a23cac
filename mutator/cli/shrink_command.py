"""`shrink`: the smallest form of a fault with the same hazard."""

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mutator._common.command_progress_events import SMALLEST_FORM_LINK, report_written_file
from mutator._common.cpu_cores import usable_cores
from mutator._common.message_text import counted
from mutator.cli.plan_and_run_commands import WORKERS_DEFAULT_HELP, resume_command
from mutator.cli.shared_options import (
    Engine,
    ExperimentId,
    Json,
    RunFolderOption,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import Terminal, short_path

if TYPE_CHECKING:
    from mutator.api.smallest_form import SmallestForm


def register(app: typer.Typer) -> None:
    app.command("shrink", epilog=EXAMPLES)(shrink)


EXAMPLES = """\b
Examples:
  mutator shrink 3f9a                        an experiment of the newest run in runs/
  mutator shrink 3f9a --run runs/first --out runs/smallest
  mutator shrink 3f9a --start                also look for a rounder start
  mutator shrink 3f9a --save radar_glitch    a campaign and a test of plain pytest from now on
"""


@with_workspace_options
def shrink(
    experiment: ExperimentId,
    run: RunFolderOption = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="DIR",
            help="The run folder of the smaller forms. Default: in shrunk/ beside the run.",
        ),
    ] = None,
    start: Annotated[bool, typer.Option("--start", help="Also look for a start with fewer digits.")] = False,
    save: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Write a campaign of the smallest form alone into the library, and a regression for pytest "
            "into regressions/ beside it.",
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("-n", "--workers", min=1, help=f"Worker processes. {WORKERS_DEFAULT_HELP}"),
    ] = None,
    engine: Engine = None,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Find the smallest fault with the same hazard: shorter, simpler, smaller.

    Drives some 20 smaller forms of an experiment that reached a hazard, and keeps those that reach it, too.
    The same command resumes an interrupted search.
    """
    from mutator.api.smallest_form import check_free_name
    from mutator.cli.experiment_printing import find_run_experiment
    from mutator.cli.progress_display import campaign_progress

    terminal = Terminal(as_json)
    workspace = workspace_options.workspace()
    run_experiment = find_run_experiment(workspace, run, experiment)
    if save is not None:
        check_free_name(workspace, save)
    try:
        with campaign_progress(terminal) as notify:
            smallest = run_experiment.shrink(
                out,
                start=start,
                workers=usable_cores() if workers is None else workers,
                engine=engine,
                progress=notify,
            )
    except KeyboardInterrupt:
        raise typer.Abort(f"interrupted; finished experiments are kept; resume: {resume_command()}") from None
    report_written_file(SMALLEST_FORM_LINK, smallest.run / smallest.experiment.id)
    saved, reason = smallest.save(save) if save is not None else ([], "")
    if as_json:
        paths = [str(path) for path in saved]
        facts = smallest.as_json() | {"commands": _commands(smallest)}
        terminal.print_json(facts | {"saved": paths, "no_campaign": reason})
    _print_smallest_form(terminal, smallest)
    for path in saved:
        terminal.print_link("saved", path)
    if reason:
        terminal.print_note(f"no campaign was written: {reason}")


def _print_smallest_form(terminal: Terminal, smallest: "SmallestForm") -> None:
    terminal.print_result(
        f"{smallest.experiment.label}: {smallest.hazard} {smallest.time_to_hazard_s:g} s after the start "
        f"({smallest.experiment.id})"
    )
    terminal.print_text(
        f"before: {smallest.original.label}: {smallest.hazard} "
        f"{smallest.original_hazard_s - smallest.original_start_s:g} s after the start"
    )
    terminal.print_text(f"minimal: {smallest.minimal}")
    if smallest.steps:
        terminal.print_table(
            ("simpler", "experiment", "id"),
            [(what, step.label, step.id) for what, step in smallest.steps],
        )
    for note in smallest.notes:
        terminal.print_text(note)
    terminal.print_text(
        f"{counted(smallest.runs, 'form')} driven, in {short_path(smallest.run)}; the smallest came out the "
        "same on the reference engine"
    )
    for introduction, command in zip(("to try it:", "to see it:"), _commands(smallest), strict=True):
        terminal.print_command(introduction, command)


def _commands(smallest: "SmallestForm") -> tuple[str, str]:
    """Return the commands that try and show the smallest form."""
    words = [smallest.experiment.id, "--run", short_path(smallest.run)]
    return shlex.join(["mutator", "rerun", *words]), shlex.join(["mutator", "show", *words, "--plot"])
