"""Builds the results table from plan and records. Equal inputs give equal bytes."""

import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import read_json, write_json, writing_temporary_path
from mutator._common.garbage_collection_pause import without_garbage_collection
from mutator._common.hashing import digest
from mutator._common.helper_processes import computing_in_background, map_in_processes, process_count_for
from mutator._common.version import VERSION
from mutator.errors import MutatorError, MutatorWarning
from mutator.outcomes.fault_paths import fault_paths_of
from mutator.results import propagation_columns
from mutator.results.csv_and_parquet_writers import (
    CsvTableWriter,
    ParquetTableWriter,
    csv_lines,
    parquet_batch,
)
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.renamed_columns import renamed_columns_in
from mutator.results.table_columns import TIMING_COLUMNS, cells_by_column, result_columns_of
from mutator.store import file_digests, plan_file
from mutator.store.file_digests import FileDigest
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.preflight_results import check_verdicts_are_final
from mutator.store.run_folder import RunFolder

CSV_FILE, PARQUET_FILE, TIMINGS_FILE = "results.csv", "results.parquet", "timings.parquet"
PROPAGATION_FILE = "propagation.parquet"
TABLE_FILES = (CSV_FILE, PARQUET_FILE, PROPAGATION_FILE, TIMINGS_FILE)
STAMP_SCHEMA, STAMP_FILE = "results/1", "results.json"
_EXPERIMENTS_PER_BATCH = 2_000  # read at a time; a million records as objects take 5 GB


def ensure_tables(run: Path) -> Path:
    """Return the path of a run folder's results.csv. Rebuild the tables if any is out of date."""
    folder = RunFolder.open_unverified(run)
    stamp = _load_stamp(folder)
    if stamp.get("made_from") == _inputs_digest(folder) and stamp["tables"] == _current_table_digests(folder):
        return folder.path / CSV_FILE
    return build_tables(run)


def build_tables(run: Path) -> Path:
    """Write the tables of a run folder from plan and records, and return the path of results.csv.

    MutatorWarning if a table that was edited by hand is overwritten, or has renamed columns. MutatorError if
    not all checks of the run have passed.
    """
    folder = RunFolder.open(run)
    check_verdicts_are_final(folder)
    inputs_digest = _inputs_digest(folder)
    with ExitStack() as stack:
        # The stack exits in reverse order, so the first table is replaced first.
        paths = {name: path_below(folder.path, name) for name in reversed(TABLE_FILES)}
        path_by_name = {
            name: stack.enter_context(writing_temporary_path(path)) for name, path in paths.items()
        }
        write_tables(folder, path_by_name)
        new_digests = {
            name: file_digest.sha256
            for name, path in path_by_name.items()
            if (file_digest := FileDigest.of_file(path))
        }
        # Record old and new digests before the tables are replaced at the end of the block. Otherwise a kill
        # could leave tables that look edited.
        before = _unedited_digests(folder, new_digests)
        _warn_of_renamed_columns(folder)
        stamp = {"schema": STAMP_SCHEMA, "made_from": inputs_digest, "tables": new_digests, "before": before}
        write_json(folder.path / STAMP_FILE, stamp)
    return folder.path / CSV_FILE


def renamed_columns_of(folder: RunFolder) -> str:
    """Return the columns of results.csv with a name of another version of mutator; '' if there are none."""
    names = [column.name for column in result_columns_of(folder)]
    return renamed_columns_in(path_below(folder.path, CSV_FILE), names)


def write_tables(folder: RunFolder, paths: Mapping[str, Path]) -> None:
    """Write the tables of a run folder to the given `paths`.

    Experiments are read in batches, so that a million of them need only a few hundred MB of memory. For a
    large run, two processes build the batches.
    """
    with computing_in_background(
        lambda: _write_timings(folder, paths[TIMINGS_FILE]),
        process_count_for(folder.planned_experiment_count),
    ) as end:
        _write_result_tables(folder, paths)
        end()


def _write_result_tables(folder: RunFolder, paths: Mapping[str, Path]) -> None:
    records, planned, columns = (
        folder.records(),
        PlannedExperiments(folder.path),
        result_columns_of(folder),
    )
    scale, fault_paths = folder.severity_scale, fault_paths_of(folder)

    def build_batch(batch: Sequence[str]) -> tuple[bytes, Any, Any]:
        finished = [FinishedExperiment(planned[name], records[name], scale, fault_paths) for name in batch]
        cells = cells_by_column(columns, finished)
        lines, table = csv_lines(zip(*cells, strict=True)), parquet_batch(columns, cells)
        departure_cells = propagation_columns.propagation_cells(
            (experiment.record for experiment in finished), folder.head.channels
        )
        return (
            lines,
            table,
            parquet_batch(propagation_columns.PROPAGATION_COLUMNS, list(departure_cells.values())),
        )

    with ExitStack() as stack:
        # it takes a fifth of the time, and rows and records have no cycles
        stack.enter_context(without_garbage_collection())
        csv = stack.enter_context(CsvTableWriter(paths[CSV_FILE], columns))
        parquet = stack.enter_context(ParquetTableWriter(paths[PARQUET_FILE], columns))
        propagated = stack.enter_context(
            ParquetTableWriter(paths[PROPAGATION_FILE], propagation_columns.PROPAGATION_COLUMNS)
        )
        batches = _batches(name for name in sorted(planned) if name in records)
        for lines, table, departures in map_in_processes(
            build_batch, batches, process_count_for(len(records))
        ):
            csv.append(lines)
            parquet.append(table)
            propagated.append(departures)


def _batches(items: Iterable[str]) -> list[list[str]]:
    all_items = list(items)
    return [
        all_items[begin : begin + _EXPERIMENTS_PER_BATCH]
        for begin in range(0, len(all_items), _EXPERIMENTS_PER_BATCH)
    ]


def _inputs_digest(folder: RunFolder) -> str:
    """Return the digest of all inputs of the tables, including the version of mutator."""
    run = folder.path
    lines = sorted(path for kind in ("records", "timings") for path in (run / kind).glob("*.jsonl"))
    files = [
        plan_file.EXPERIMENTS_FILE,
        plan_file.FAULTS_FILE,
        *(path.relative_to(run).as_posix() for path in lines),
    ]
    input_digests = list(file_digests.digests_of_files(run, files).items())
    head = folder.head
    head_facts = (head.hazards, head.compared, head.metrics, head.severity, head.channels, head.structure)
    columns = [
        (column.name, column.type)
        for column in (*result_columns_of(folder), *propagation_columns.PROPAGATION_COLUMNS, *TIMING_COLUMNS)
    ]
    scenarios = [head.scenarios] if head.scenarios else []
    return digest([STAMP_SCHEMA, VERSION, *head_facts, columns, input_digests, *scenarios])


def _current_table_digests(folder: RunFolder) -> dict[str, str | None]:
    digests = file_digests.digests_of_files(folder.path, TABLE_FILES)
    return {name: file_digest.sha256 if file_digest else None for name, file_digest in digests.items()}


def _load_stamp(folder: RunFolder) -> dict[str, Any]:
    try:
        stamp = read_json(folder.path / STAMP_FILE, STAMP_SCHEMA)
        if all(isinstance(stamp[key], dict) for key in ("tables", "before")):
            return stamp
    except (MutatorError, KeyError):
        pass
    return {"made_from": None, "tables": {}, "before": {}}


def _unedited_digests(folder: RunFolder, new_digests: Mapping[str, str]) -> dict[str, str]:
    """Return the digests of the tables that a build wrote, and warn about tables that were edited since."""
    stamp = _load_stamp(folder)
    current = {
        name: table_digest
        for name, table_digest in _current_table_digests(folder).items()
        if table_digest is not None
    }
    built = {
        name: (new_digests[name], stamp["tables"].get(name), stamp["before"].get(name)) for name in current
    }
    for name in current:
        if current[name] not in built[name]:
            text = "the table did not match the plan and records, so it was rebuilt"
            warnings.warn(f"{path_below(folder.path, name)}: {text}", MutatorWarning, stacklevel=2)
    return {name: current_digest for name, current_digest in current.items() if current_digest in built[name]}


def _warn_of_renamed_columns(folder: RunFolder) -> None:
    if renamed := renamed_columns_of(folder):
        text = f"the tables had the columns of another version of mutator ({renamed}), so they were rebuilt"
        warnings.warn(f"{folder.path}: {text}", MutatorWarning, stacklevel=2)


def _write_timings(folder: RunFolder, path: Path) -> None:
    newest = folder.timings()

    def build_batch(batch: Sequence[str]) -> Any:
        lines = [newest[name] for name in batch]
        return parquet_batch(
            TIMING_COLUMNS, [[line.get(column.name) for line in lines] for column in TIMING_COLUMNS]
        )

    with ParquetTableWriter(path, TIMING_COLUMNS) as file:
        for batch in _batches(sorted(newest)):
            file.append(build_batch(batch))
