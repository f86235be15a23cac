"""Write a run folder in one of the formats of `mutator export`."""

from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.doors import EXPORTS
from mutator._common.files import make_folder, write_atomic
from mutator.exports import ExportRequest, Parts, check_options, find_export
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

FOLDER = "exports"
WHOLE = Parts()


def export(
    run: Path,
    format: str,
    out: Path | None = None,
    *,
    workspace: Workspace | None = None,
    parts: Parts = WHOLE,
) -> Path:
    """Write the run folder `run` as `format` to `out` (default: RUN/exports/); return the file or folder.

    A mutation report needs the `workspace` with the target; MCAP uses it to read exact traces. MutatorError
    for an unknown format, or a target that has changed since the run.
    """
    found = find_export(format)
    folder = RunFolder.open(run)
    check_options(format, found, parts)
    with EXPORTS.blaming_package(format):
        place = out or path_below(folder.path / FOLDER, found.file.format(table=parts.table.value))
        content = found.write(ExportRequest(folder=folder, out=place, workspace=workspace, parts=parts))
        if not isinstance(content, bytes | None):
            raise TypeError(f"`write` returns {type(content).__name__}, not bytes")
    if content is not None:
        make_folder(place.parent)
        write_atomic(place, content)
    return place
