from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mutator._common.below import inside
from mutator._common.files import make_folder, write_atomic
from mutator.errors import MutatorError
from mutator.exports import Format, Table, elements, junit, mcap_export
from mutator.results.table_reader import Results
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

FOLDER = "exports"

FILES = {Format.MUTATION_ELEMENTS: "mutation-elements.json", Format.JUNIT: "junit.xml", Format.MCAP: "mcap"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The part of a run to write: the outcomes that JUnit reports as failures, a filter over the columns of
    the results for MCAP, the table for CSV and Parquet.
    """

    failures: Sequence[str] = ()
    only: str | None = None
    table: Table = Table.RESULTS


def export(
    run: Path,
    format: Format,
    out: Path | None = None,
    *,
    workspace: Workspace | None = None,
    parts: Parts = Parts(),
) -> Path:
    """Write the run folder `run` as `format` to `out` (default: RUN/exports/); return the file or folder.

    A mutation report needs the `workspace` with the target; MCAP uses it to read exact traces. MutatorError
    for a target that has changed since the run.
    """
    folder = RunFolder.open(run)
    if parts.only is not None and format is not Format.MCAP:
        raise MutatorError(f"not valid for {format.value}", argument="only", remedy="leave `only` out")
    if parts.table is not Table.RESULTS and format not in (Format.CSV, Format.PARQUET):
        raise MutatorError(f"not valid for {format.value}", argument="table", remedy="leave `table` out")
    if parts.failures and format is not Format.JUNIT:
        raise MutatorError(
            f"not valid for {format.value}", argument="failures", remedy="leave `failures` out"
        )
    place = out or inside(folder.path / FOLDER, FILES.get(format, f"{parts.table.value}.{format.value}"))
    if format is Format.MCAP:
        return mcap_export.write_experiments(folder, place, workspace, parts.only)
    make_folder(place.parent)
    write_atomic(place, _content(folder, format, workspace, parts))
    return place


def _content(folder: RunFolder, format: Format, workspace: Workspace | None, parts: Parts) -> bytes:
    if format is Format.MUTATION_ELEMENTS:
        assert workspace is not None
        return elements.content(folder, workspace)
    if format is Format.JUNIT:
        return junit.content(folder, parts.failures)
    table = Results.up_to_date(folder.path)
    if parts.table is Table.RESULTS:
        return table.csv() if format is Format.CSV else table.parquet()
    is_timings = parts.table is Table.TIMINGS
    if format is Format.PARQUET:
        return table.timings_parquet() if is_timings else table.propagation_parquet()
    frame = table.timings() if is_timings else table.propagation()
    return frame.to_csv(index=False, lineterminator="\n").encode()
