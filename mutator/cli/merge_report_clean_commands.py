"""`merge`, `report` and `clean`: work with run folders."""

import shlex
import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.message_text import counted
from mutator.cli import shell_completion
from mutator.cli.shared_options import (
    AcceptVersions,
    Json,
    OutRunFolder,
    Wide,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import Terminal, short_path
from mutator.errors import MutatorError

if TYPE_CHECKING:
    from mutator.api.runs import Run
    from mutator.workspace import Workspace


def register(app: typer.Typer) -> None:
    app.command("merge", epilog=MERGE_EXAMPLES)(merge)
    app.command("report", epilog=REPORT_EXAMPLES)(report)
    app.command("clean", epilog=CLEAN_EXAMPLES)(clean)


def print_outcome_counts(terminal: Terminal, run: "Run") -> None:
    if note := run.no_canary_note():
        terminal.print_text(note, style="bold")
    if note := run.golden_hazards_note():
        terminal.print_text(note, style="bold")
    counts = run.counts()
    important = {"any hazard", "hazard, no alert"}
    terminal.print_table(
        counts.heads,
        counts.rows,
        right_aligned=tuple(counts.right_aligned),
        priorities=[0, *(i for i, head in enumerate(counts.heads) if head in important)],
        last_is_total=True,
    )
    score = run.mutation_totals()
    if score.rows:
        terminal.print_table(score.heads, score.rows, right_aligned=tuple(score.right_aligned))
    for text in run.folder.head.operators:  # names files that could not be changed
        terminal.print_text(text)
    with suppress(MutatorError):  # the note needs the library
        if note := run.alerts_note():
            terminal.print_text(note)
    if run.folder.early_end_note:
        terminal.print_text(run.folder.early_end_note)
    terminal.print_result(f"outcomes: {', '.join(f'{name} {n}' for name, n in run.endings.items())}")


MERGE_EXAMPLES = """\b
Examples:
  mutator merge runs/part1 runs/part2 runs/part3 --out runs/whole
"""


def merge(
    shards: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR", help="The run folder of each shard.", autocompletion=shell_completion.complete_runs
        ),
    ],
    out: OutRunFolder,
    accept_versions: AcceptVersions = False,
    as_json: Json = False,
) -> None:
    """Merge the shards of a plan into one run folder.

    The results are the same, byte for byte, as those of a run on a single machine.
    """
    terminal = Terminal(as_json)
    with terminal.show_spinner("merging"):
        merged = mutator.merge_runs(shards, out, accept_versions=accept_versions)
        # computing the digests takes time, too
        planned, seals = merged.folder.planned_experiment_count, merged.seals
    if as_json:
        counts = {"run": str(out), "shards": len(shards), "experiments": planned}
        terminal.print_json(counts | asdict(seals))
    results = short_path(out / "results.csv")
    terminal.print_text(f"{counted(planned, 'experiment')} of {counted(len(shards), 'shard')}: {results}")
    for name, value in seals.digest_by_name().items():
        terminal.print_text(f"{name}: {value}")
    terminal.print_command("report:", shlex.join(["mutator", "report", str(out)]))


REPORT_EXAMPLES = """\b
Examples:
  mutator report runs/first
  mutator report runs/first --single-file        one file to send, with replays
  mutator report /data/night --root ~/openpilot-faults
  mutator report runs                            history of all runs in a folder
"""


@with_workspace_options
def report(
    run: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="A run folder, or a folder of runs.",
            autocompletion=shell_completion.complete_runs,
        ),
    ],
    wide: Wide = False,
    single_file: Annotated[
        bool,
        typer.Option(
            "--single-file",
            help="Also write DIR/exports/<run>-report.html: the page with replays of the worst experiments "
            "inside (at most 4 MB of them), which works without any other file.",
        ),
    ] = False,
    as_json: Json = False,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Write the report of a run, or the history of a folder of runs.

    The report of an unfinished run covers the results so far. If the library cites published results, they
    appear next to yours. If the run's equivalence check failed, the command writes the report and then fails.
    """
    terminal = Terminal(as_json, wide)
    if not (run / "run.json").exists() and any(run.glob("*/run.json")):
        if single_file:
            raise MutatorError(
                "--single-file for a folder of runs",
                where=run,
                expected="a run folder",
                remedy="name one of its runs; a history is one file anyway",
            )
        _write_history(terminal, run)
        return
    loaded_run = mutator.load_run(run, workspace=workspace_if_any(workspace_options))
    with terminal.show_spinner("writing the report"):  # this can rerun a few experiments
        report_files = loaded_run.report(anew=True, single_file=single_file)
    if as_json:
        facts = {
            "markdown": str(report_files.markdown),
            "page": str(report_files.page),
            "rows": report_files.rows,
        }
        if report_files.single_file:
            facts["single_file"] = str(report_files.single_file)
        terminal.print_json(facts)
    print_outcome_counts(terminal, loaded_run)
    for summary in report_files.summaries:
        terminal.print_table(summary.heads, summary.rows, right_aligned=tuple(summary.right_aligned))
    terminal.print_text(f"report: {short_path(report_files.markdown)} and {short_path(report_files.page)}")
    if report_files.single_file:
        size_mb = report_files.single_file.stat().st_size / 1e6
        terminal.print_text(f"single file: {short_path(report_files.single_file)} ({size_mb:.1f} MB)")
    loaded_run.check_equivalence()  # last, because the report is wanted even if this fails


def _write_history(terminal: Terminal, folder: Path) -> None:
    history = mutator.write_history(folder)
    paths = {"markdown": str(history.markdown), "page": str(history.page)}
    if terminal.as_json:
        terminal.print_json({**paths, "runs": history.runs, "left_out": list(history.left_out)})
    for reason in history.left_out:
        terminal.print_text(f"left out: {reason}")
    files = f"{short_path(history.markdown)} and {short_path(history.page)}"
    terminal.print_text(f"history of {counted(history.runs, 'run')}: {files}")


def workspace_if_any(workspace_options: WorkspaceOptions) -> "Workspace | None":
    """Find the workspace; None if no option names one and none is found."""
    try:
        return workspace_options.workspace()
    except MutatorError:
        if workspace_options != WorkspaceOptions():
            raise
        return None


CLEAN_EXAMPLES = """\b
Examples:
  mutator clean runs/first
  mutator clean runs/* --yes
"""


def clean(
    runs: Annotated[
        list[Path],
        typer.Argument(metavar="DIR", help="Run folders.", autocompletion=shell_completion.complete_runs),
    ],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Delete without asking.")] = False,
) -> None:
    """Delete run folders.

    Refuses a link, a run in progress, and a folder that holds anything that the run did not write.
    """
    from mutator.api.caches import check_run_folder, delete_run_folder

    terminal = Terminal()
    for run in runs:
        check_run_folder(run)  # refuse before the first folder is deleted
    if not yes:
        if not sys.stdin.isatty():
            raise MutatorError("no terminal to ask for confirmation", remedy="add --yes to delete anyway")
        if not typer.confirm(f"delete {', '.join(map(short_path, runs))}?"):
            return
    for run in runs:
        delete_run_folder(run)
        terminal.print_text(f"deleted {short_path(run)}")
