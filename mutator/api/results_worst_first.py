"""The worst results of a run, optionally filtered."""

from pathlib import Path

from mutator.campaigns.row_filters import matching_items
from mutator.results.experiment_sentence import ExperimentSentences, ResultCells
from mutator.results.result_rows import ResultRow, cells_by_row, rows_of
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_ranks, worst_of_each_cause
from mutator.store import plan_file
from mutator.store.run_head import load_head

_ROWS_PER_BATCH = 10_000  # to filter; as dictionaries, all rows of a large run would fill the memory


def worst_results(
    run: Path, only: str | None = None, limit: int | None = None
) -> tuple[list[ResultRow], int]:
    """Return at most `limit` results of a run folder, worst first, and the number of all that match.

    `only` is a filter over the columns of the results. MutatorError for an invalid filter.
    """
    frame = Results.up_to_date(run).frame()
    row_indices = (
        worst_first_ranks(frame).argsort().tolist()
    )  # sort all rows first, because filtering keeps the order
    if only is not None:
        batches = range(0, len(frame), _ROWS_PER_BATCH)
        rows = (row for first in batches for row in cells_by_row(frame.iloc[first : first + _ROWS_PER_BATCH]))
        matches = matching_items(enumerate(rows), only, list(frame.columns), _filter_row)
        matching_indices = {index for index, _ in matches}
        row_indices = [index for index in row_indices if index in matching_indices]
    sentences = ExperimentSentences.of_run(load_head(run))
    worst = rows_of(frame.iloc[row_indices[:limit]], plan_file.load_faults(run), sentences)
    return worst, len(row_indices)


def _filter_row(numbered_row: tuple[int, ResultCells]) -> ResultCells:
    """Return the row as filters know it: with None for an empty cell, which is a text."""
    _, row = numbered_row
    return {name: None if cell == "" else cell for name, cell in row.items()}


def worst_causes(run: Path, limit: int | None = None) -> tuple[list[tuple[ResultRow, int]], int]:
    """Return the worst result of each cause (fault type and hazard) and how many more it has, worst first, at
    most `limit`; and the number of all results.
    """
    frame = Results.up_to_date(run).frame()
    worst, more = worst_of_each_cause(frame.iloc[worst_first_ranks(frame).argsort()])
    rows = rows_of(worst.iloc[:limit], plan_file.load_faults(run), ExperimentSentences.of_run(load_head(run)))
    return list(zip(rows, more, strict=False)), len(frame)
