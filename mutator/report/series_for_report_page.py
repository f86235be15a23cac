"""Finds the series that the report's page loads, and writes missing ones."""

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from mutator.errors import MutatorError
from mutator.execution.run_traces import RunTraces
from mutator.outcomes.series_sampling import write_sampled_series
from mutator.results.table_columns import deviation_column_by_channel
from mutator.store.missing_series import reason_for_missing_series
from mutator.store.run_folder import RunFolder
from mutator.store.time_series_folder import TimeSeriesFolder

if TYPE_CHECKING:
    from mutator.workspace import Workspace


def series_facts_for_page(folder: RunFolder) -> dict[str, Any]:
    """Whether series are packed, which experiments have their own file, why others have none, and the columns
    with the largest deviation of each channel, which its curves must have. The page must not request a
    missing file, because the browser's console would show an error.
    """
    series = TimeSeriesFolder(folder.path)
    columns = dict(deviation_column_by_channel(folder.head.compared))
    return {
        "packed": series.is_packed,
        "kept": series.rerun_ids(),
        "reason_if_missing": reason_for_missing_series(folder, is_packed=series.is_packed),
        "deviations": columns,
    }


def write_missing_series_of_traces(folder: RunFolder, workspace: "Workspace") -> None:
    """Write the missing or damaged series of experiments whose traces are kept."""
    traces, series = RunTraces(workspace, folder), TimeSeriesFolder(folder.path)
    for name in sorted(path.name for path in (folder.path / "traces").glob("*")):
        with suppress(MutatorError, KeyError):  # for example, the sources changed after the run
            if not series.is_readable(name, traces.record(name)) and traces.is_faulty_trace_stored(name):
                write_sampled_series(
                    folder.path, traces.manifest, *traces.traces_of(name), traces.record(name)
                )
