"""The progress of a campaign: a live bar in a terminal, now and then a line elsewhere."""

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mutator.cli.console import Terminal

if TYPE_CHECKING:
    from mutator.store.records import Progress

LINE_EVERY_S = 15.0  # in a log file a line now and then shows that it lives

STAGES = {
    "plan": "planning",
    "checks": "checks before the campaign",
    "experiments": "experiments",
    "results": "results",
}


@contextmanager
def campaign_progress(terminal: Terminal) -> Iterator[Callable[["Progress"], None]]:
    """Yields what the campaign calls with its progress, from whatever thread."""
    if terminal.err.is_terminal:
        with _live(terminal) as notify:
            yield notify
    else:
        yield _Lines(terminal)


@contextmanager
def _live(terminal: Terminal) -> Iterator[Callable[["Progress"], None]]:
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
                description=STAGES.get(progress.stage, progress.stage),
                completed=progress.done,
                total=progress.total or 1,  # a stage without a count has an empty bar
                count=count(progress),
                rate=rate(progress),
                outcomes=endings(progress.outcomes) or progress.detail,
                remaining=remaining(progress),
            )

        yield notify


class _Lines:
    """One line at each new stage, then one every `LINE_EVERY_S`."""

    def __init__(self, terminal: Terminal) -> None:
        self.terminal = terminal
        self.stage = ""
        self.next_s = 0.0

    def __call__(self, progress: "Progress") -> None:
        now = time.monotonic()
        if progress.stage == self.stage and now < self.next_s:
            return
        self.stage, self.next_s = progress.stage, now + LINE_EVERY_S
        parts = [f"{STAGES.get(progress.stage, progress.stage)} {count(progress)}".rstrip()]
        known = (rate(progress), endings(progress.outcomes), remaining(progress))
        parts += [part for part in known if part]
        self.terminal.note(", ".join(parts))


def count(progress: "Progress") -> str:
    """`12/60`, where there is something to count."""
    return f"{progress.done}/{progress.total}" if progress.total else ""


def rate(progress: "Progress") -> str:
    """`1.5 a second` or, where it takes longer, `24.0 a minute`: how fast it goes, when that is known."""
    if progress.per_s is None:
        return ""
    if progress.per_s < 1.0:
        return f"{60 * progress.per_s:.1f} a minute"
    return f"{progress.per_s:.1f} a second"


def endings(outcomes: Counter[str]) -> str:
    """`hazard 12, sdc 30, masked 2`: the outcomes so far."""
    return ", ".join(f"{name} {outcomes[name]}" for name in sorted(outcomes) if outcomes[name])


def remaining(progress: "Progress") -> str:
    """How long it will still take, when that is known."""
    return "" if progress.remaining_s is None else f"{duration(progress.remaining_s)} left"


def duration(seconds: float) -> str:
    """`45 s`, `3 min 20 s`, `2 h 05 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
