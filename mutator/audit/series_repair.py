"""Set aside damaged series of a run folder, so that the others can be read.

A chunk of golden series is rebuilt from the golden runs if that gives the same bytes.
"""

import os
from collections.abc import Callable, Iterator
from pathlib import Path

from mutator._common.confined_files import checked_relative_path, unlink_below, write_below
from mutator.audit.series_audit import audit_series
from mutator.errors import MutatorError
from mutator.outcomes.hazard_and_metric_judgement import load_manifest_channels
from mutator.outcomes.series_sampling import SeriesSampler
from mutator.store.golden_files import GOLDEN_FOLDER, golden_output_folder
from mutator.store.run_folder import RunFolder
from mutator.store.series_packing import WORKER_FILE_SUFFIX, repack_series
from mutator.store.series_script import script_bytes, script_name_of
from mutator.store.time_series_folder import INDEX_NAME, SeriesIndex, TimeSeriesFolder, rerun_command
from mutator.workspace import Workspace


def repair_series(
    folder: RunFolder, workspace: Workspace | None, set_aside: Callable[[str], None]
) -> Iterator[str]:
    """Set aside damaged series, and yield a sentence for each action.

    `set_aside` copies a file of the run folder. Golden runs can be read only with a `workspace`.
    """
    run, series_folder = folder.path, TimeSeriesFolder(folder.path)
    paths = {Path(problem.where) for problem in audit_series(folder)[1] if problem.where}
    index = None
    if series_folder.path / f"{INDEX_NAME}.js" in paths:  # the content of the chunks is unknown
        paths |= {*series_folder.path.glob("*.js")}
    elif paths:
        index = series_folder.index
    for path in sorted(paths):
        name = path.relative_to(run).as_posix()
        checked_relative_path(name, run)
        what_happened = "set aside" if os.path.lexists(path) else "is gone"
        set_aside(name)
        if path.suffix == WORKER_FILE_SUFFIX:
            yield f"{name}: damaged blocks set aside; `mutator run` packs the others"
        elif index and (data := _rebuilt_golden_chunk(folder, workspace, index, path.stem)):
            write_below(run, name, script_bytes(path.stem, data))
            yield f"{name} rebuilt from the golden runs"
        else:
            unlink_below(run, name)
            yield f"{name} {what_happened}: {rerun_command(run)} recreates the series of an experiment"
    if index:
        repack_series(run, index)


def _rebuilt_golden_chunk(
    folder: RunFolder, workspace: Workspace | None, index: SeriesIndex, name: str
) -> bytes | None:
    """Return the rebuilt content of a chunk of golden series, if that is still possible."""
    keys = {number: key for key, number in index.entry_number_by_golden.items()}
    numbers = [number for number, (chunk, _) in enumerate(index.entry_places) if chunk == name]
    if workspace is None or not keys.keys() >= {*numbers}:
        return None
    try:
        manifest = workspace.manifest_of(folder.head)
        goldens = [
            load_manifest_channels(manifest, golden_output_folder(folder.path / GOLDEN_FOLDER, keys[number]))
            for number in numbers
        ]
    except MutatorError:
        return None
    data = b"".join(SeriesSampler(manifest, golden).encoded_golden for golden in goldens)
    return data if script_name_of(data) == name else None
