"""Timings on disk: what each experiment cost, where it ran, and when it ended."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mutator.store.indexed_lines import IndexedLines

TIMINGS_FOLDER, TIMINGS_SCHEMA = "timings", "timings/2"  # the folder of the files of lines
_LONGEST_RUN_S = 1e9  # 30 years: no run takes longer, and sums of such times are finite
# the digest of what ran (`executed_code`); why an experiment was not left out of a run with `--since`
_OPTIONAL_TEXTS = frozenset(("executed", "affected"))
_TIME_FORMAT = "%Y-%m-%dT%H:%M:%SZ"


def ending_text(moment: datetime) -> str:
    """Return the text of `ended` for a moment in UTC."""
    return moment.strftime(_TIME_FORMAT)


def ending_of(line: Mapping[str, Any]) -> datetime | None:
    """Return when the experiment of a timing line ended (UTC); None in lines of older versions.

    ValueError for another text.
    """
    text = line.get("ended")
    return None if text is None else datetime.strptime(text, _TIME_FORMAT).replace(tzinfo=UTC)


def load_timings(run: Path) -> IndexedLines[dict[str, Any]]:
    """Return the newest timing line of each experiment that has one; MutatorError for a damaged line."""
    paths = sorted((run / TIMINGS_FOLDER).glob("*.jsonl"))
    return IndexedLines(paths, TIMINGS_SCHEMA, _checked_timing, lambda line, earlier: True)


def _checked_timing(data: dict[str, Any]) -> dict[str, Any]:
    """Check the types of a timing line, which anybody can edit: the seal leaves it out."""
    for name in ("cpu_s", "wall_s"):
        if type(data[name]) not in (int, float) or not 0.0 <= data[name] <= _LONGEST_RUN_S:
            raise ValueError(name)
    for name in ("experiment_id", "host", "worker", "engine", "why", *(data.keys() & _OPTIONAL_TEXTS)):
        value = data[name]  # `engine` is None if nothing ran
        if not (isinstance(value, str) or (name == "engine" and value is None)):
            raise ValueError(name)
        if name != "why" and value and not value.isprintable():
            raise ValueError(name)
    ending_of(data)
    return data
