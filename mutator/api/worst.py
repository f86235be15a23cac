"""The worst results of a run, those that a filter accepts."""

from collections.abc import Mapping
from pathlib import Path

from mutator.campaigns.filters import compile_filter
from mutator.outcomes.columns import is_text
from mutator.outcomes.ranking import worst
from mutator.outcomes.reader import Results
from mutator.outcomes.rows import Row, row_from


def worst_results(run: Path, only: str | None = None) -> list[Row]:
    """The rows of a run folder, the worst first; of those for which the filter `only` over the columns of its
    results holds (`severity >= "S2" and not alerts`). The table is brought up to date first; MutatorError for
    a filter that does not fit it."""
    lines = list(Results.up_to_date(run).lines())
    rows = worst(map(row_from, lines))  # of all: those that are left keep their order
    if only is None:
        return rows
    accepts = compile_filter(only, list(lines[0]) if lines else [])
    accepted = {line["experiment_id"] for line in lines if accepts(_typed(line))}
    return [row for row in rows if row.experiment_id in accepted]


def _typed(line: Mapping[str, str]) -> dict[str, object]:
    """Cells as a filter compares them: numbers as numbers, nothing as None."""
    return {name: _value(name, text) if text else None for name, text in line.items()}


def _value(name: str, text: str) -> object:
    if is_text(name):
        return text
    try:
        return float(text)
    except ValueError:  # a fault's value may be a word
        return text
