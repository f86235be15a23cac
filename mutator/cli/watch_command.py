"""`watch`: run what an edit affects, as long as somebody edits."""

import shlex
import warnings
from collections.abc import Callable
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import mutator
from mutator._common.cpu_cores import usable_cores
from mutator._common.message_text import counted
from mutator.cli.plan_and_run_commands import WORKERS_DEFAULT_HELP, CampaignName
from mutator.cli.shared_options import (
    Engine,
    Exclude,
    Limit,
    Only,
    Proportional,
    Reading,
    Seed,
    WorkspaceOptions,
    with_workspace_options,
)
from mutator.cli.terminal_output import STYLE_BY_ENDING, Terminal, show_error
from mutator.errors import MutatorError
from mutator.execution.progress_text import describe_duration, describe_outcomes

if TYPE_CHECKING:
    from mutator.api.watching import NewVerdict, VerdictChanges
    from mutator.execution.session_summary import Summary
    from mutator.execution.watched_campaign import PlannedPass, Verdict
    from mutator.store.run_progress import Progress

_MOST_LISTED_VERDICTS = 10

EXAMPLES = """\b
Examples:
  mutator watch quickstart
  mutator watch my_campaign.yaml --only 'fault_type == "chaff"' -n 4
  mutator watch quickstart --target ~/controller/src --out runs/desk

Each pass is a run folder: `now` below --out, with the pass `before` beside it. Ctrl-C ends the command.
"""


def register(app: typer.Typer) -> None:
    app.command("watch", epilog=EXAMPLES)(watch)


@with_workspace_options
def watch(
    campaign: CampaignName,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Folder for the passes. Default: runs/watch."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("-n", "--workers", min=1, help=f"Worker processes. {WORKERS_DEFAULT_HELP}")
    ] = None,
    only: Only = None,
    exclude: Exclude = None,
    limit: Limit = None,
    proportional: Proportional = False,
    seed: Seed = None,
    reading: Reading = None,
    engine: Engine = None,
    *,
    workspace_options: WorkspaceOptions,
) -> None:
    """Run a campaign, and again what each edit affects.

    Edits of the target, the library and the templates count. Verdicts that have changed come first.
    """
    from mutator.api.watching import watch_campaign

    folder = out or Path("runs", "watch")
    terminal = Terminal()
    with ExitStack() as stack, warnings.catch_warnings():
        warnings.simplefilter("ignore", mutator.IncompleteRun)  # the last line of a pass reports it
        code = watch_campaign(
            workspace_options.workspace(),
            campaign,
            folder,
            _Display(terminal, folder, stack),
            choices=mutator.Choices(
                seed=seed, reading=reading, only=only, exclude=exclude, limit=limit, proportional=proportional
            ),
            workers=usable_cores() if workers is None else workers,
            engine=engine,
        )
    terminal.print_note("stopped")
    if code:
        raise typer.Exit(code)


class _Display:
    """Prints what happens. The bar of a pass is below the text, and `stack` removes it."""

    def __init__(self, terminal: Terminal, folder: Path, stack: ExitStack) -> None:
        self._terminal, self._folder, self._stack = terminal, folder, stack
        self._show_progress: Callable[[Progress], None] | None = None
        self._unchanged = self._unlisted = self._listed = 0

    def begin_pass(self, planned: "PlannedPass", is_first: bool) -> None:
        from mutator.api.watching import PYTHON_NOTE
        from mutator.cli.progress_display import campaign_progress

        self._unchanged = self._unlisted = self._listed = 0
        if is_first:
            count = counted(len(planned.plan.experiments), "experiment")
            self._terminal.print_text(f"watching {planned.plan.campaign.name}: {count}; Ctrl-C ends")
            command = shlex.join(["mutator", "serve", str(self._folder)])
            self._terminal.print_command("in a browser:", command)
            if PYTHON_NOTE:
                self._terminal.print_note(PYTHON_NOTE)
        self._show_progress = self._stack.enter_context(campaign_progress(self._terminal))

    def progress(self, progress: "Progress") -> None:
        if self._show_progress:
            self._show_progress(progress)

    def verdicts(self, changes: "VerdictChanges") -> None:
        self._unchanged += changes.unchanged
        if not changes.new:
            self._terminal.print_text(f"no change in {counted(changes.unchanged, 'experiment')}")
        for verdict in changes.new:
            if self._listed == _MOST_LISTED_VERDICTS:
                self._unlisted += 1
                continue
            self._listed += 1
            style = STYLE_BY_ENDING.get(verdict.row.ending)
            self._terminal.print_text(_describe_verdict(verdict), style)

    def end_pass(self, summary: "Summary", removed: int) -> None:
        self._end_progress()
        counts = {
            "new or changed": self._listed + self._unlisted,
            "unchanged": self._unchanged,
            "gone": removed,
        }
        parts = [f"{text}: {number:,}" for text, number in counts.items() if number]
        if self._unlisted:
            self._terminal.print_text(f"and {self._unlisted:,} more that are new or have changed")
        took = f"({describe_duration(summary.elapsed_s)})"
        outcomes = describe_outcomes(summary.outcomes)
        self._terminal.print_text("; ".join(filter(None, (*parts, f"all: {outcomes} {took}"))))
        for note in (summary.reuse_note, summary.since_note):
            if note:
                self._terminal.print_note(note)
        if summary.harness_errors:
            name, detail = summary.harness_errors[0]
            errors = counted(len(summary.harness_errors), "harness error")
            self._terminal.print_error(f"{errors}; first: {name}: {detail}")
        if summary.problem:
            self._terminal.print_error(summary.problem)

    def nothing_affected(self) -> None:
        self._terminal.print_text("nothing that this campaign runs has changed")

    def edited(self, names: str, *, is_restart: bool) -> None:
        self._end_progress()
        what = "edited during the pass, which begins again" if is_restart else "edited"
        self._terminal.print_text()
        self._terminal.print_text(f"{datetime.now():%H:%M:%S} {names} {what}")

    def error(self, error: MutatorError) -> None:
        self._end_progress()
        show_error(error)
        self._terminal.print_note("waiting for the next edit")

    def _end_progress(self) -> None:
        self._show_progress = None
        self._stack.close()


def _describe_verdict(verdict: "NewVerdict") -> str:
    row = verdict.row
    now = " ".join((row.ending, *(name for name, _ in row.hazards)))
    before = f" (was {_describe_before(verdict.before)})" if verdict.before else ""
    return f"{now}{before}: {verdict.experiment.label} [{verdict.experiment.id[:8]}]"


def _describe_before(before: "Verdict") -> str:
    status, outcome, hazards = before
    return " ".join((outcome or status, *hazards))
