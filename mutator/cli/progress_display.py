"""The progress of a campaign: a live bar in a terminal, occasional lines elsewhere."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import TYPE_CHECKING

from mutator._common import progress_events
from mutator.cli.console import Terminal
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


@contextmanager
def campaign_progress(terminal: Terminal) -> Iterator[Callable[["Progress"], None]]:
    """Show progress; yield the function that the campaign calls, from any thread."""
    with (
        _live_progress_bar(terminal)
        if terminal.err.is_terminal
        else nullcontext(ProgressLines(terminal.print_note)) as show
    ):

        def notify(progress: "Progress") -> None:
            progress_events.report_phase(
                stage_title(progress), progress.done, progress.total, progress.outcomes
            )
            show(progress)

        yield notify


@contextmanager
def _live_progress_bar(terminal: Terminal) -> Iterator[Callable[["Progress"], None]]:
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bars

    columns = (
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[count]}"),
        TextColumn("{task.fields[rate]}"),
        TextColumn("{task.fields[outcomes]}"),
        TimeElapsedColumn(),
        TextColumn("{task.fields[remaining]}"),
    )
    with Bars(*columns, console=terminal.err, transient=True) as bars:
        task = bars.add_task("starting", total=None, count="", rate="", outcomes="", remaining="")

        def notify(progress: "Progress") -> None:
            bars.update(
                task,
                description=stage_title(progress),
                completed=progress.done,
                total=progress.total or 1,  # a stage without a count has an empty bar
                count=describe_count(progress),
                rate=describe_rate(progress),
                outcomes=", ".join(filter(None, (describe_outcomes(progress.outcomes), progress.detail))),
                remaining=describe_remaining_time(progress),
            )

        yield notify
