"""The progress of a campaign: a live bar in a terminal, occasional lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import TYPE_CHECKING, Any

from mutator._common import command_progress_events
from mutator.cli.terminal_output import Terminal
from mutator.execution.progress_text import (
    ProgressLines,
    describe_count,
    describe_outcomes,
    describe_rate,
    describe_remaining_time,
    stage_title,
)

if TYPE_CHECKING:
    from mutator.store.run_progress import Progress


_BAR_AND_CLOCK_WIDTH = 10 + 7 + 6  # the shortest bar, the elapsed time, and the spaces between columns


@contextmanager
def campaign_progress(terminal: Terminal) -> Iterator[Callable[["Progress"], None]]:
    """Show progress; yield the function that the campaign calls, from any thread."""
    # one line for each message, however long: a log is searched line by line
    lines = ProgressLines(partial(terminal.print_note, without_folding=True))
    with _live_progress_bar(terminal) if terminal.err.is_terminal else nullcontext(lines) as show:

        def notify(progress: "Progress") -> None:
            command_progress_events.report_phase(
                stage_title(progress), progress.done, progress.total, progress.outcomes
            )
            show(progress)

        yield notify


@contextmanager
def _live_progress_bar(terminal: Terminal) -> Iterator[Callable[["Progress"], None]]:
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[count]}"),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[outcomes]}"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[remaining]}"),
    )
    with terminal.show_bars(*columns) as bars:
        task = bars.add_task("starting", total=None, count="", rate="", outcomes="", remaining="")

        def notify(progress: "Progress") -> None:
            bars.update(
                task,
                description=stage_title(progress),
                completed=progress.done,
                total=progress.total or 1,  # a stage without a count has an empty bar
                **_fields_that_fit(progress, terminal.err.width),
            )

        yield notify


def _fields_that_fit(progress: "Progress", width: int) -> dict[str, Any]:
    """Return what to show beside the bar, empty where the terminal is too narrow for it."""
    texts = {
        "count": describe_count(progress),
        "remaining": describe_remaining_time(progress),
        "outcomes": ", ".join(filter(None, (describe_outcomes(progress.outcomes), progress.detail))),
        "rate": describe_rate(progress),
    }
    room = width - len(stage_title(progress)) - _BAR_AND_CLOCK_WIDTH
    for name, text in texts.items():
        if len(text) > room:
            texts[name] = ""
        else:
            room -= len(text)
    return texts
