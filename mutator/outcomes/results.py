"""The results table: a row per experiment, made from plan and records at any time, always the same bytes."""

import gc
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from mutator._common.files import half_written, read_json, write_json
from mutator._common.hashing import digest
from mutator._common.version import VERSION
from mutator.errors import MutatorError, MutatorWarning
from mutator.model import Experiment, Record, Status
from mutator.outcomes import propagation
from mutator.outcomes.columns import (
    T_END,
    TIMINGS,
    deviation_columns,
    hazard_columns,
    plan_row,
    result_columns,
    severity_columns,
)
from mutator.outcomes.paths import ways_of
from mutator.outcomes.propagation import columns_of
from mutator.outcomes.table_files import CsvTable, ParquetTable
from mutator.outcomes.verdicts import reaction_time, severity_of, since_activation, since_manifestation
from mutator.store import digests, plan_file
from mutator.store.digests import Digest
from mutator.store.planned import Planned
from mutator.store.run_folder import RunFolder
from mutator.targets.severity import Scale

CSV, PARQUET, TIMINGS_PARQUET = "results.csv", "results.parquet", "timings.parquet"
PROPAGATION = "propagation.parquet"
TABLES = (CSV, PARQUET, PROPAGATION, TIMINGS_PARQUET)
SCHEMA, STAMP = "results/1", "results.json"
_BATCH = 5_000  # experiments that are read before their rows are written
_TIME_DIGITS = 6  # of a time in s: beyond any step length, within any double


def row(
    experiment: Experiment,
    record: Record,
    hazards: Sequence[str],
    *,
    ends: bool = False,
    scale: Scale | None = None,
) -> dict[str, object]:
    """One row by column, in any order; without the largest differences where the run left no trace.

    `hazards` are those that the target checks; `ends` says that one of them can end the drive, and `scale`
    makes classes of delta-v. None stands for nothing; flags are 0 or 1; times are seconds of simulation
    since its start.
    """
    cells = plan_row(experiment) | _verdict_cells(record, scale)
    ok, times = record.status is Status.OK, dict(record.hazards)
    for name in hazards:
        flag, time = hazard_columns(name)
        cells[flag.name] = int(name in times) if ok else None
        cells[time.name] = _time(times.get(name))
    columns = deviation_columns([name for name, _ in record.max_dev])
    cells |= {columns[name]: value for name, value in record.max_dev}
    if ends:
        driven = dict(record.max_dev) | dict(record.dev)
        cells |= {columns[name].removeprefix("max_"): value for name, value in driven.items()}
        cells[T_END] = _time(record.t_end)
    return cells | dict(record.metrics)


def _verdict_cells(record: Record, scale: Scale | None) -> dict[str, object]:
    """The cells that every target's results have."""
    activation = record.activation
    ok = record.status is Status.OK
    return {
        "status": record.status.value,
        "outcome": record.outcome.value if record.outcome else None,
        "activated": 1 if activation else (0 if ok else None),
        "t_activation": _time(activation.first) if activation else None,
        "activations": activation.count if activation else (0 if ok else None),
        "manifested": int(record.t_manifest is not None) if ok else None,
        "t_manifest": _time(record.t_manifest),
        "alerts": ";".join(name for name, _ in record.alerts) or None,
        "t_alert": _time(record.alerts[0][1]) if record.alerts else None,
        "reaction_time": _time(reaction_time(record.hazards, record.alerts)),
        "severity": severity_of(record, scale),
        "fault_tolerant_time": _time(since_activation(record)),
        "manifest_to_hazard": _time(since_manifestation(record)),
        "detail": record.detail or None,
    }


def _time(value: float | None) -> float | None:
    return None if value is None else round(value, _TIME_DIGITS)


def ensure(run: Path) -> Path:
    """results.csv of a run folder: as it is when all tables are what was made of what the folder holds now,
    else built."""
    folder = RunFolder.unverified(run)
    stamp = _stamp(folder)
    if stamp.get("made_from") == _made_from(folder) and stamp["tables"] == _found(folder):
        return folder.path / CSV
    return build(run)


def build(run: Path) -> Path:
    """Write results.csv (returned) and the other tables of a run folder from its plan and records. A
    MutatorWarning tells of a table that somebody has edited: it is no more."""
    folder = RunFolder.open(run)
    made_from = _made_from(folder)
    with ExitStack() as stack:
        paths = {name: folder.path / name for name in reversed(names(folder))}  # the first one is kept first
        made = {name: stack.enter_context(half_written(path)) for name, path in paths.items()}
        write(folder, made)
        now = {name: found.sha256 for name, path in made.items() if (found := Digest.of_file(path))}
        # first what is there and what will be, so that a table which a kill left is not taken for an edited
        # one; then, as the block ends, the tables
        before = _unedited(folder, now)
        stamp = {"schema": SCHEMA, "made_from": made_from, "tables": now, "before": before}
        write_json(folder.path / STAMP, stamp)
    return folder.path / CSV


def names(folder: RunFolder) -> tuple[str, ...]:
    """The tables that a folder has; runs of earlier versions recorded no propagation."""
    return tuple(name for name in TABLES if name != PROPAGATION or "channels" in folder.head)


def write(folder: RunFolder, paths: Mapping[str, Path]) -> None:
    """Write the tables of a run folder, made from its plan, records and timings, each to its path in `paths`.

    Experiments are read by their ids, a batch at a time: a million takes some hundred MB.
    """
    records, planned, table = folder.records(), Planned(folder.path), _Table(folder)
    with ExitStack() as stack:
        stack.enter_context(_without_collection())
        csv = stack.enter_context(CsvTable(paths[CSV], table.columns))
        parquet = stack.enter_context(ParquetTable(paths[PARQUET], table.columns))
        propagated = None
        if PROPAGATION in paths:
            propagated = stack.enter_context(ParquetTable(paths[PROPAGATION], propagation.COLUMNS))
        for batch in _batches(name for name in sorted(planned) if name in records):
            done = [(planned[name], records[name]) for name in batch]
            rows = [table.cells(*one) for one in done]
            csv.append(rows)
            parquet.append(list(zip(*rows, strict=True)))
            if propagated:
                found = columns_of((record for _, record in done), folder.head["channels"])
                propagated.append(list(found.values()))
    _write_timings(folder, paths[TIMINGS_PARQUET])


@contextmanager
def _without_collection() -> Iterator[None]:
    """No search for garbage in circles: rows and records are none, and a fifth of the time went there."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


class _Table:
    """The columns of a run's results.csv, and the cells of its rows."""

    def __init__(self, folder: RunFolder) -> None:
        head = folder.head
        metrics = head.get("metrics", ())
        self._hazards, self._scale, self._ways = head["hazards"], folder.scale, ways_of(head)
        self._ends = T_END in (name for name, *_ in metrics)
        self.columns = result_columns(
            *(head["hazards"], head["compared"], metrics, severity_columns(head)),
            paths=self._ways is not None,
        )
        self._names = [column.name for column in self.columns]

    def cells(self, experiment: Experiment, record: Record) -> list[object]:
        """A row, in the order of the columns."""
        made = row(experiment, record, self._hazards, ends=self._ends, scale=self._scale)
        course = self._ways.course(experiment.fault, record) if self._ways else None
        if course:
            made |= {"reached": course.reached or None, "stopped_at": ";".join(course.stopped_at) or None}
        return list(map(made.get, self._names))


def _batches(items: Iterable[str]) -> Iterator[tuple[str, ...]]:
    left = iter(items)
    while batch := tuple(islice(left, _BATCH)):
        yield batch


def _made_from(folder: RunFolder) -> str:
    """Digest of all that the tables follow from, this version of mutator included."""
    run = folder.path
    lines = sorted(path for kind in ("records", "timings") for path in (run / kind).glob("*.jsonl"))
    files = [run / plan_file.EXPERIMENTS, run / plan_file.FAULTS, *lines]
    names = (path.relative_to(run).as_posix() for path in files)
    found = list(zip(names, digests.of_files(files), strict=True))
    head = folder.head
    told = [head["hazards"], head["compared"], head.get("metrics", [])]
    told += [head[key] for key in ("severity", "channels", "structure") if key in head]
    return digest([SCHEMA, VERSION, *told, found])


def _found(folder: RunFolder) -> dict[str, str | None]:
    """Digests of the tables as they are now; None of a missing one."""
    known = names(folder)
    found = dict(zip(known, digests.of_files([folder.path / name for name in known]), strict=True))
    return {name: one.sha256 if one else None for name, one in found.items()}


def _stamp(folder: RunFolder) -> dict[str, Any]:
    """What results.json says; as good as nothing where it is missing or damaged."""
    try:
        known = read_json(folder.path / STAMP, SCHEMA)
        if all(isinstance(known[key], dict) for key in ("tables", "before")):
            return known
    except (MutatorError, KeyError):
        pass
    return {"made_from": None, "tables": {}, "before": {}}


def _unedited(folder: RunFolder, now: Mapping[str, str]) -> dict[str, str]:
    """Digests of the tables that are there and were made by a build; a warning tells of any other one. Of old
    folders without results.json nobody knows."""
    stamp = _stamp(folder)
    tells = folder.verifiable or stamp.get("made_from")
    found = {name: one for name, one in _found(folder).items() if one is not None}
    made = {name: (now[name], stamp["tables"].get(name), stamp["before"].get(name)) for name in found}
    for name in found:
        if tells and found[name] not in made[name]:
            text = f"{folder.path / name}: not what was made from plan and records; made anew"
            warnings.warn(text, MutatorWarning, stacklevel=2)
    return {name: one for name, one in found.items() if one in made[name]}


def _write_timings(folder: RunFolder, path: Path) -> None:
    """What each experiment cost, where."""
    newest = folder.timings()
    with ParquetTable(path, TIMINGS) as file:
        for batch in _batches(sorted(newest)):
            lines = [newest[name] for name in batch]
            file.append([[line.get(column.name) for line in lines] for column in TIMINGS])
