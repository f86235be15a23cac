"""Writes a run in the format that is asked for."""

from collections.abc import Sequence
from pathlib import Path

from mutator._common.files import make_folder, write_atomic
from mutator.exports import Format, elements, junit
from mutator.outcomes import results
from mutator.outcomes.reader import Results
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

FOLDER = "exports"


FILES = {
    Format.MUTATION_ELEMENTS: "mutation-elements.json",
    Format.JUNIT: "junit.xml",
    Format.CSV: results.CSV,
    Format.PARQUET: results.PARQUET,
}


def export(
    run: Path,
    format: Format,
    out: Path | None = None,
    *,
    workspace: Workspace | None = None,
    failures: Sequence[str] = (),
) -> Path:
    """Write the run folder `run` as `format` to `out` (default: RUN/exports/); returns the file.

    A mutation report shows sources, so it needs the `workspace` with the target that was run; `failures` are
    the endings that JUnit is told as failures. MutatorError for a target that has changed since.
    """
    folder = RunFolder.open(run)
    place = out or folder.path / FOLDER / FILES[format]
    make_folder(place.parent)
    write_atomic(place, _content(folder, format, workspace, failures))
    return place


def _content(
    folder: RunFolder, format: Format, workspace: Workspace | None, failures: Sequence[str]
) -> bytes:
    if format is Format.MUTATION_ELEMENTS:
        assert workspace is not None
        return elements.content(folder, workspace)
    if format is Format.JUNIT:
        return junit.content(folder, failures)
    table = Results.up_to_date(folder.path)
    return table.csv() if format is Format.CSV else table.parquet()
