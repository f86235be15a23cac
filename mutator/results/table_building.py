"""Builds the results table from plan and records. Equal inputs give equal bytes."""

import gc
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from mutator._common.confined_files import path_below
from mutator._common.files import read_json, write_json, writing_temporary_path
from mutator._common.hashing import digest
from mutator._common.helper_processes import computing_meanwhile, map_in_processes, process_count_for
from mutator._common.version import VERSION
from mutator.errors import MutatorError, MutatorWarning
from mutator.outcomes.fault_paths import fault_paths_of
from mutator.results import propagation_columns
from mutator.results.table_columns import TIMINGS, Finished, cells_of, columns_of
from mutator.results.table_files import CsvTable, ParquetTable, csv_lines, record_batch
from mutator.store import file_digests, plan_file
from mutator.store.file_digests import FileDigest
from mutator.store.planned_experiments import PlannedExperiments
from mutator.store.run_folder import RunFolder

CSV, PARQUET, TIMINGS_PARQUET = "results.csv", "results.parquet", "timings.parquet"
PROPAGATION = "propagation.parquet"
TABLES = (CSV, PARQUET, PROPAGATION, TIMINGS_PARQUET)
SCHEMA, STAMP = "results/1", "results.json"
_BATCH = 2_000  # experiments read at a time


def ensure(run: Path) -> Path:
    """Return the path of a run folder's results.csv. Rebuild the tables if any is out of date."""
    folder = RunFolder.open_unverified(run)
    stamp = _stamp(folder)
    if stamp.get("made_from") == _made_from(folder) and stamp["tables"] == _found(folder):
        return folder.path / CSV
    return build(run)


def build(run: Path) -> Path:
    """Write the tables of a run folder from plan and records, and return the path of results.csv.

    MutatorWarning if a table that was edited by hand is overwritten.
    """
    folder = RunFolder.open(run)
    made_from = _made_from(folder)
    with ExitStack() as stack:
        # The stack exits in reverse order, so the first table is replaced first.
        paths = {name: path_below(folder.path, name) for name in reversed(TABLES)}
        made = {name: stack.enter_context(writing_temporary_path(path)) for name, path in paths.items()}
        write(folder, made)
        now = {name: found.sha256 for name, path in made.items() if (found := FileDigest.of_file(path))}
        # Record old and new digests before the tables are replaced at the end of the block. Otherwise a kill
        # could leave tables that look edited.
        before = _unedited(folder, now)
        stamp = {"schema": SCHEMA, "made_from": made_from, "tables": now, "before": before}
        write_json(folder.path / STAMP, stamp)
    return folder.path / CSV


def write(folder: RunFolder, paths: Mapping[str, Path]) -> None:
    """Write the tables of a run folder to the given `paths`.

    Experiments are read in batches, so that a million of them need only a few hundred MB of memory. For a
    large run, two processes build the batches.
    """
    with computing_meanwhile(
        lambda: _write_timings(folder, paths[TIMINGS_PARQUET]), process_count_for(folder.planned_count)
    ) as end:
        _write_results(folder, paths)
        end()


def _write_results(folder: RunFolder, paths: Mapping[str, Path]) -> None:
    records, planned, columns = folder.records(), PlannedExperiments(folder.path), columns_of(folder.head)
    scale, fault_paths = folder.severity_scale, fault_paths_of(folder)

    def made(batch: Sequence[str]) -> tuple[bytes, Any, Any]:
        finished = [Finished(planned[name], records[name], scale, fault_paths) for name in batch]
        cells = cells_of(columns, finished)
        lines, table = csv_lines(zip(*cells, strict=True)), record_batch(columns, cells)
        found = propagation_columns.columns_of((one.record for one in finished), folder.head.channels)
        return lines, table, record_batch(propagation_columns.COLUMNS, list(found.values()))

    with ExitStack() as stack:
        stack.enter_context(_without_collection())
        csv = stack.enter_context(CsvTable(paths[CSV], columns))
        parquet = stack.enter_context(ParquetTable(paths[PARQUET], columns))
        propagated = stack.enter_context(ParquetTable(paths[PROPAGATION], propagation_columns.COLUMNS))
        batches = _batches(name for name in sorted(planned) if name in records)
        for lines, table, departures in map_in_processes(made, batches, process_count_for(len(records))):
            csv.append(lines)
            parquet.append(table)
            propagated.append(departures)


@contextmanager
def _without_collection() -> Iterator[None]:
    """Disable garbage collection, which takes a fifth of the time: rows and records have no cycles."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


def _batches(items: Iterable[str]) -> list[list[str]]:
    found = list(items)
    return [found[begin : begin + _BATCH] for begin in range(0, len(found), _BATCH)]


def _made_from(folder: RunFolder) -> str:
    """Return the digest of all inputs of the tables, including the version of mutator."""
    run = folder.path
    lines = sorted(path for kind in ("records", "timings") for path in (run / kind).glob("*.jsonl"))
    files = [plan_file.EXPERIMENTS, plan_file.FAULTS, *(path.relative_to(run).as_posix() for path in lines)]
    found = list(file_digests.digests_of_files(run, files).items())
    head = folder.head
    told = (head.hazards, head.compared, head.metrics, head.severity, head.channels, head.structure)
    columns = [(one.name, one.type) for one in (*columns_of(head), *propagation_columns.COLUMNS, *TIMINGS)]
    return digest([SCHEMA, VERSION, *told, columns, found])


def _found(folder: RunFolder) -> dict[str, str | None]:
    found = file_digests.digests_of_files(folder.path, TABLES)
    return {name: one.sha256 if one else None for name, one in found.items()}


def _stamp(folder: RunFolder) -> dict[str, Any]:
    try:
        known = read_json(folder.path / STAMP, SCHEMA)
        if all(isinstance(known[key], dict) for key in ("tables", "before")):
            return known
    except (MutatorError, KeyError):
        pass
    return {"made_from": None, "tables": {}, "before": {}}


def _unedited(folder: RunFolder, now: Mapping[str, str]) -> dict[str, str]:
    """Return the digests of the tables that a build wrote, and warn about tables that were edited since."""
    stamp = _stamp(folder)
    found = {name: one for name, one in _found(folder).items() if one is not None}
    made = {name: (now[name], stamp["tables"].get(name), stamp["before"].get(name)) for name in found}
    for name in found:
        if found[name] not in made[name]:
            text = "the table did not match the plan and records, so it was rebuilt"
            warnings.warn(f"{path_below(folder.path, name)}: {text}", MutatorWarning, stacklevel=2)
    return {name: one for name, one in found.items() if one in made[name]}


def _write_timings(folder: RunFolder, path: Path) -> None:
    newest = folder.timings()

    def made(batch: Sequence[str]) -> Any:
        lines = [newest[name] for name in batch]
        return record_batch(TIMINGS, [[line.get(column.name) for line in lines] for column in TIMINGS])

    with ParquetTable(path, TIMINGS) as file:
        for batch in _batches(sorted(newest)):
            file.append(made(batch))
