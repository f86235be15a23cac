"""What the report's page knows of series: which there are beside it."""

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from mutator.errors import MutatorError
from mutator.execution.traces import Traces
from mutator.outcomes.sampling import keep_series
from mutator.store.run_folder import RunFolder
from mutator.store.series import SeriesFolder

if TYPE_CHECKING:
    from mutator.workspace import Workspace


def series_facts(folder: RunFolder) -> dict[str, Any]:
    """Whether series are packed, and which experiments have theirs in a file of its own: a page asks for no
    file that is not there, as that would be an error in its console."""
    series = SeriesFolder(folder.path)
    return {"packed": series.is_packed, "kept": series.kept_ids()}


def sample_kept_traces(folder: RunFolder, workspace: "Workspace") -> None:
    """Make the series of each experiment whose trace is kept, and that has none, or a damaged one."""
    traces, series = Traces(workspace, folder), SeriesFolder(folder.path)
    for name in sorted(path.name for path in (folder.path / "traces").glob("*")):
        with suppress(
            MutatorError, KeyError
        ):  # the sources have changed, say, or the trace is of another state
            if not series.is_readable(name) and traces.is_kept(name):
                keep_series(folder.path, traces.manifest, *traces.of(name), traces.record(name))
