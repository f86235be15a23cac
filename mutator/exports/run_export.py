"""Write a run folder in one of the formats of `mutator export`."""

from pathlib import Path

from mutator._common.confined_files import path_below
from mutator._common.extension_doors import EXPORT_DOOR
from mutator._common.files import make_folder, write_atomic
from mutator.exports import ExportRequest, ExportSelection, check_options, find_export
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

EXPORTS_FOLDER = "exports"
WHOLE_RUN_SELECTION = ExportSelection()


def export(
    run: Path,
    format: str,
    out: Path | None = None,
    *,
    workspace: Workspace | None = None,
    selection: ExportSelection = WHOLE_RUN_SELECTION,
) -> Path:
    """Write the run folder `run` as `format` to `out` (default: RUN/exports/); return the file or folder.

    A mutation report needs the `workspace` with the target; MCAP uses it to read exact traces. MutatorError
    for an unknown format, or a target that has changed since the run.
    """
    chosen_format = find_export(format)
    folder = RunFolder.open(run)
    check_options(format, chosen_format, selection)
    with EXPORT_DOOR.blaming_package(format):
        name = chosen_format.file.format(table=selection.table.value)
        path = out or path_below(folder.path / EXPORTS_FOLDER, name)
        content = chosen_format.write(
            ExportRequest(folder=folder, out=path, workspace=workspace, selection=selection)
        )
        if not isinstance(content, bytes | None):
            raise TypeError(f"`write` returns {type(content).__name__}, not bytes")
    if content is not None:
        make_folder(path.parent)
        write_atomic(path, content)
    return path
