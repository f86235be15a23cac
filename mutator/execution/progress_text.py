"""Describe a run's progress."""

import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mutator.store.run_progress import Progress

LINE_EVERY_S = 15.0  # so that a log shows that the run is alive

STAGE_TITLES = {
    "plan": "planning",
    "checks": "checks",
    "golden": "golden runs",
    "experiments": "experiments",
    "proof": "proof",
    "tables": "tables",
    "pictures": "pictures",
    "report": "report",
}


class ProgressLines:
    """Writes a line at each new stage, then one every `LINE_EVERY_S` seconds."""

    def __init__(self, write_line: Callable[[str], None]) -> None:
        self._write_line = write_line
        self._stage = ""
        self._next_line_s = 0.0

    def __call__(self, progress: "Progress") -> None:
        now = time.monotonic()
        if progress.stage == self._stage and now < self._next_line_s:
            return
        self._stage, self._next_line_s = progress.stage, now + LINE_EVERY_S
        parts = [f"{stage_title(progress)} {describe_count(progress)}".rstrip()]
        details = (
            describe_rate(progress),
            describe_outcomes(progress.outcomes),
            describe_remaining_time(progress),
            progress.detail,
        )
        self._write_line(", ".join([*parts, *(part for part in details if part)]))


def stage_title(progress: "Progress") -> str:
    return STAGE_TITLES.get(progress.stage, progress.stage)


def describe_count(progress: "Progress") -> str:
    return f"{progress.done}/{progress.total}" if progress.total else ""


def describe_rate(progress: "Progress") -> str:
    """Return the rate if known: `1.5 a second`, or `24.0 a minute` for slow runs."""
    if progress.per_s is None:
        return ""
    if progress.per_s < 1.0:
        return f"{60 * progress.per_s:.1f} a minute"
    return f"{progress.per_s:.1f} a second"


def describe_outcomes(outcomes: Counter[str]) -> str:
    """Return the outcomes so far: `hazard 12, sdc 30, masked 2`."""
    return ", ".join(f"{name} {outcomes[name]}" for name in sorted(outcomes) if outcomes[name])


def describe_remaining_time(progress: "Progress") -> str:
    return "" if not progress.remaining_s else f"{describe_duration(progress.remaining_s)} left"


def describe_duration(seconds: float) -> str:
    """Format a duration: `45 s`, `3 min 20 s`, `2 h 05 min`."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60:02d} s"
    return f"{whole // 3600} h {whole % 3600 // 60:02d} min"
