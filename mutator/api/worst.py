"""The worst results of a run, optionally filtered."""

from collections.abc import Mapping
from pathlib import Path

from mutator.campaigns.filters import compile_filter
from mutator.results.column_facts import is_text
from mutator.results.ranking import places
from mutator.results.rows import Row, lines_of, rows_of
from mutator.results.table_reader import Results

_BATCH = 10_000  # rows filtered at a time


def worst_results(run: Path, only: str | None = None, limit: int | None = None) -> tuple[list[Row], int]:
    """Return at most `limit` results of a run folder, worst first, and the number of all that match.

    `only` is a filter over the columns of the results. MutatorError for an invalid filter.
    """
    texts = Results.up_to_date(run).texts()
    order = places(texts).argsort().tolist()  # sort all rows first, because filtering keeps the order
    if only is not None:
        accepts = compile_filter(only, list(texts.columns))
        batches = range(0, len(texts), _BATCH)
        lines = (line for first in batches for line in lines_of(texts.iloc[first : first + _BATCH]))
        fits = [accepts(_typed(line)) for line in lines]
        order = [row for row in order if fits[row]]
    return rows_of(texts.iloc[order[:limit]]), len(order)


def _typed(line: Mapping[str, str]) -> dict[str, object]:
    return {name: _value(name, text) if text else None for name, text in line.items()}


def _value(name: str, text: str) -> object:
    if is_text(name):
        return text
    try:
        return float(text)
    except ValueError:  # a fault's value can be text
        return text
