"""The results table: a row per experiment, made from plan and records at any time, always the same bytes."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from mutator._common.files import write_atomic
from mutator.model import Experiment, Record, Status
from mutator.outcomes.columns import (
    TIMINGS,
    Column,
    deviation_columns,
    hazard_columns,
    plan_row,
    result_columns,
)
from mutator.outcomes.verdicts import reaction_time
from mutator.store import plan_file
from mutator.store.records import TIMINGS_SCHEMA, read_lines, read_records
from mutator.store.run_folder import RunFolder

CSV, PARQUET, TIMINGS_PARQUET = "results.csv", "results.parquet", "timings.parquet"
_TIME_DIGITS = 6  # of a time in s: beyond any step length, within any double


def row(experiment: Experiment, record: Record, hazards: Sequence[str]) -> dict[str, object]:
    """One row by column, in any order; without the largest differences where the run left no trace.

    `hazards` are those that the target checks. None for nothing; flags are 0 or 1; times are seconds of
    simulation since its start.
    """
    activation = record.activation
    ok = record.status is Status.OK
    cells: dict[str, object] = plan_row(experiment)
    cells |= {
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
        "detail": record.detail or None,
    }
    times = dict(record.hazards)
    for name in hazards:
        flag, time = hazard_columns(name)
        cells[flag.name] = int(name in times) if ok else None
        cells[time.name] = _time(times.get(name))
    columns = deviation_columns([name for name, _ in record.max_dev])
    return cells | {columns[name]: value for name, value in record.max_dev}


def _time(value: float | None) -> float | None:
    return None if value is None else round(value, _TIME_DIGITS)


def ensure(run: Path) -> Path:
    """results.csv of a run folder: as it is when all derived files are newer than all they are made from,
    else built."""
    derived = [run / name for name in (CSV, PARQUET, TIMINGS_PARQUET)]
    if all(path.is_file() for path in derived):
        made_from = [run / "run.json", *run.glob("records/*.jsonl"), *run.glob("timings/*.jsonl")]
        oldest = min(path.stat().st_mtime_ns for path in derived)
        if all(path.stat().st_mtime_ns < oldest for path in made_from):
            return derived[0]
    return build(run)


def build(run: Path) -> Path:
    """Write results.csv (returned), results.parquet and timings.parquet of a run folder from its plan and
    records."""
    folder = RunFolder.open(run)
    records = read_records(folder.path)
    experiments = sorted(plan_file.read_all(folder.path), key=lambda e: e.id)
    head = folder.head
    columns = result_columns(head["hazards"], head["compared"])
    rows = [row(e, records[e.id], head["hazards"]) for e in experiments if e.id in records]
    write_atomic(folder.path / CSV, _csv(rows, [column.name for column in columns]))
    write_atomic(folder.path / PARQUET, _parquet(rows, columns))
    write_atomic(folder.path / TIMINGS_PARQUET, _timings(folder.path))
    return folder.path / CSV


def _csv(rows: list[dict[str, object]], columns: list[str]) -> bytes:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue().encode()


def _parquet(rows: list[dict[str, object]], columns: Sequence[Column]) -> bytes:
    """The rows as a Parquet file; nothing in it depends on when or where it was made."""
    import pyarrow as pa  # type: ignore[import-untyped]
    from pyarrow import parquet

    types = {"text": pa.string(), "flag": pa.int8(), "count": pa.int64(), "number": pa.float64()}
    schema = pa.schema([(column.name, types[column.type]) for column in columns])
    table = pa.table(
        {field.name: pa.array([r.get(field.name) for r in rows], field.type) for field in schema}, schema
    )
    sink = io.BytesIO()
    parquet.write_table(table, sink, compression="zstd")
    return sink.getvalue()


def _timings(run: Path) -> bytes:
    """What each experiment cost, where: its newest line wins."""
    newest: dict[str, dict[str, object]] = {}
    for path in sorted((run / "timings").glob("*.jsonl")):
        newest |= {line["experiment_id"]: line for line in read_lines(path, TIMINGS_SCHEMA)}
    return _parquet([newest[name] for name in sorted(newest)], TIMINGS)
