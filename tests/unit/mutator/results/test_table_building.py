"""The tables of a run: what they contain, their bytes, and when they are built."""

import csv
import io
import os
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from mutator._common.files import writing_temporary_path
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorWarning
from mutator.model import Record
from mutator.outcomes.fault_paths import fault_paths_of
from mutator.results import csv_and_parquet_writers, propagation_columns, table_building
from mutator.results.csv_and_parquet_writers import TableColumn
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.table_columns import TIMING_COLUMNS, cells_by_column, result_columns_of
from mutator.store import plan_file
from mutator.store.checksummed_lines import LineWriter
from mutator.store.records import RECORDS_SCHEMA
from mutator.store.run_folder import RunFolder
from mutator.store.timings import TIMINGS_SCHEMA
from mutator.workspace import Workspace

MakeRecord = Callable[..., Record]


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path, record: MakeRecord) -> RunFolder:
    """A run with records of all experiments except two, in two files."""
    plan = build_plan(toycar, "toy")
    folder = freeze_plan(plan, tmp_path / "run", toycar)
    for i in (0, 1):
        writer = LineWriter(
            folder.path / "records" / f"0001-gw{i}.jsonl",
            {"schema": RECORDS_SCHEMA, "plan": folder.head.plan},
        )
        timings = LineWriter(folder.path / "timings" / f"0001-gw{i}.jsonl", {"schema": TIMINGS_SCHEMA})
        for experiment in plan.experiments[i:22:2]:
            writer.append(asdict(record(experiment.id, max_dev=(("gas", 0.5), ("wheel_turn", 0.25)))))
            timings.append(
                {"experiment_id": experiment.id, "cpu_s": 1.0, "wall_s": 2.0, "host": "h", "worker": "gw"}
                | {"engine": "fork", "why": ""}
            )
        writer.close()
        timings.close()
    return folder


def test_tables_are_sorted_and_complete(folder: RunFolder) -> None:
    rows = list(csv.DictReader(table_building.build_tables(folder.path).open()))
    assert (len(rows), folder.planned_experiment_count) == (22, 24)
    ids = [row["experiment_id"] for row in rows]
    assert ids == sorted(ids)
    table = pq.read_table(folder.path / "results.parquet")
    assert table.column_names == list(rows[0])
    assert [name for name in table.column_names if f"t_{name}" in table.column_names] == [
        "h1",
        "h3",
        "too_fast",
    ]
    assert [name for name in table.column_names if name.startswith("max_dev_")] == [
        "max_dev_gas",
        "max_dev_brake",
        "max_dev_wheel",
    ]
    assert table.column("experiment_id").to_pylist() == ids
    for name in ("value", "t_activation", "max_dev_wheel", "activated"):
        texts = [row[name] for row in rows]
        assert [float(text) if text else None for text in texts] == table.column(name).to_pylist()
    timings = pq.read_table(folder.path / "timings.parquet")
    assert timings.column("experiment_id").to_pylist() == ids


def test_building_again_gives_the_same_bytes(folder: RunFolder, reseal: Callable[[Path], None]) -> None:
    tables = table_building.build_tables(folder.path), folder.path / "results.parquet"
    before = [table.read_bytes() for table in tables]
    one, two = sorted((folder.path / "records").iterdir())
    heads, lines = zip(*(path.read_text().split("\n", 1) for path in (one, two)), strict=True)
    for path, head, line in zip((one, two), heads, reversed(lines), strict=True):
        path.write_text("\n".join((head, line)))
    reseal(folder.path)
    table_building.build_tables(folder.path)
    assert [table.read_bytes() for table in tables] == before


def made_at_once(folder: RunFolder) -> dict[str, bytes]:
    records = folder.records()
    planned = sorted(plan_file.load_experiments(folder.path), key=lambda e: e.id)
    done = [(e, records[e.id]) for e in planned if e.id in records]
    columns = result_columns_of(folder)
    names = [column.name for column in columns]
    made = [
        cells_by_column(columns, [FinishedExperiment(*one, folder.severity_scale, fault_paths_of(folder))])
        for one in done
    ]
    rows = [{name: cell for name, (cell,) in zip(names, cells, strict=True)} for cells in made]
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n", restval="")
    writer.writeheader()
    writer.writerows(rows)
    lines = [line for _, line in sorted(folder.timings().items())]
    left = [(r.experiment_id, *one) for _, r in done for one in r.left]
    facts = {channel.name: (channel.component, channel.role.value) for channel in folder.head.channels}
    cells = [(name, ch, *facts.get(ch, ("", "")), round(first, 6), most) for name, ch, first, most in left]
    left_names = [column.name for column in propagation_columns.PROPAGATION_COLUMNS]
    return {
        table_building.CSV_FILE: text.getvalue().encode(),
        table_building.PARQUET_FILE: parquet_at_once(rows, columns),
        table_building.TIMINGS_FILE: parquet_at_once(lines, TIMING_COLUMNS),
        table_building.PROPAGATION_FILE: parquet_at_once(
            [dict(zip(left_names, one, strict=True)) for one in cells],
            propagation_columns.PROPAGATION_COLUMNS,
        ),
    }


def parquet_at_once(rows: Sequence[Mapping[str, Any]], columns: Sequence[TableColumn]) -> bytes:
    types = {"text": pa.string(), "flag": pa.int8(), "count": pa.int64(), "number": pa.float64()}
    schema = pa.schema([(column.name, types[column.type]) for column in columns])
    arrays = {c.name: pa.array([row.get(c.name) for row in rows], types[c.type]) for c in columns}
    sink = io.BytesIO()
    pq.write_table(pa.table(arrays, schema), sink, compression="zstd")
    return sink.getvalue()


@pytest.mark.parametrize(("batch", "processes"), [(1, 1), (7, 2), (5_000, 1)])
def test_tables_built_in_batches_have_the_same_bytes(
    folder: RunFolder, monkeypatch: pytest.MonkeyPatch, record: MakeRecord, batch: int, processes: int
) -> None:
    left = (("gas", 2.0000001, 0.5), ("v_ego", 2.05, 1e-7), ("strange", 2.1, 3.0))
    last = plan_file.load_experiments(folder.path)[22]
    lines = LineWriter(
        folder.path / "records" / "0002-gw0.jsonl", {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
    )
    lines.append(asdict(record(last.id, left=left, detail='a "b",\nc', t_manifest=2.05)))
    lines.close()
    monkeypatch.setattr(table_building, "_EXPERIMENTS_PER_BATCH", batch)
    monkeypatch.setattr(table_building, "process_count_for", lambda experiments: processes)
    for _ in range(2):
        table_building.build_tables(folder.path)
        made = {name: (folder.path / name).read_bytes() for name in table_building.TABLE_FILES}
        assert made == made_at_once(folder)
        for kind in ("records", "timings"):
            for path in (folder.path / kind).iterdir():
                path.unlink()


def test_row_groups_of_a_long_table_have_the_same_size(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(csv_and_parquet_writers, "_MOST_ROW_GROUP_ROWS", 4)
    columns = (TableColumn("n", "count", "", ""),)
    for size, groups in ((0, [0]), (4, [4]), (8, [4, 4]), (11, [4, 4, 3])):
        for batch in (1, 3, 20):
            with csv_and_parquet_writers.ParquetTableWriter(tmp_path / "t.parquet", columns) as file:
                for first in range(0, size, batch):
                    some = range(first, min(size, first + batch))
                    file.append(csv_and_parquet_writers.parquet_batch(columns, [some]))
            found = pq.ParquetFile(tmp_path / "t.parquet")
            assert [found.metadata.row_group(i).num_rows for i in range(found.num_row_groups)] == groups
            assert found.read()["n"].to_pylist() == list(range(size))


def is_rebuilt(folder: RunFolder, monkeypatch: pytest.MonkeyPatch) -> bool:
    built: list[Path] = []
    monkeypatch.setattr(
        table_building, "build_tables", lambda run: built.append(run) or run / table_building.CSV_FILE
    )
    assert table_building.ensure_tables(folder.path) == folder.path / table_building.CSV_FILE
    return bool(built)


def test_nothing_is_built_while_the_digests_are_the_same(
    folder: RunFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    table_building.build_tables(folder.path)
    os.utime(folder.path / "records" / "0001-gw0.jsonl")
    os.utime(folder.path / "results.csv", (1, 1))
    assert not is_rebuilt(folder, monkeypatch)


@pytest.mark.parametrize(
    "changed",
    ["more records", "fewer timings", "results.csv", "results.parquet", "timings.parquet", "results.json"],
)
@pytest.mark.parametrize("gone", [True, False])
def test_tables_are_rebuilt_after_any_change(
    folder: RunFolder, monkeypatch: pytest.MonkeyPatch, changed: str, gone: bool
) -> None:
    table_building.build_tables(folder.path)
    if changed == "more records":
        head = {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
        LineWriter(folder.path / "records" / "0002-gw0.jsonl", head).close()
    elif changed == "fewer timings":
        (folder.path / "timings" / "0001-gw1.jsonl").unlink()
    elif gone:
        (folder.path / changed).unlink()
    else:
        path = folder.path / changed
        path.write_bytes(path.read_bytes().replace(b"1", b"2", 1))
    assert is_rebuilt(folder, monkeypatch)


def with_numbers_for_counts(columns: Sequence[Any]) -> list[Any]:
    return [replace(one, type="number") if one.type == "count" else one for one in columns]


@pytest.mark.parametrize(
    "change", [lambda columns: columns[:-1], with_numbers_for_counts], ids=["name", "type"]
)
def test_tables_are_rebuilt_after_a_change_of_columns(
    folder: RunFolder, monkeypatch: pytest.MonkeyPatch, change: Callable[..., Any]
) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(table_building, "result_columns_of", lambda folder: change(result_columns_of(folder)))
        table_building.build_tables(folder.path)
    assert is_rebuilt(folder, monkeypatch)


@pytest.mark.parametrize("stamp", [True, False])
def test_replacing_an_edited_table_is_reported(folder: RunFolder, stamp: bool) -> None:
    table = table_building.build_tables(folder.path)
    made = table.read_bytes()
    table.write_bytes(made.replace(b"masked", b"hazard", 1))
    if not stamp:
        (folder.path / table_building.STAMP_FILE).unlink()
    with pytest.warns(MutatorWarning, match=r"results\.csv: the table did not match the plan and records"):
        table_building.ensure_tables(folder.path)
    assert table.read_bytes() == made


def test_an_interrupted_build_is_not_reported_as_an_edited_table(
    folder: RunFolder, monkeypatch: pytest.MonkeyPatch, record: MakeRecord
) -> None:
    table_building.build_tables(folder.path)
    planned = plan_file.load_experiments(folder.path)
    for killed_before, number in ((table_building.CSV_FILE, 2), (table_building.PARQUET_FILE, 3)):
        head = {"schema": RECORDS_SCHEMA, "plan": folder.head.plan}
        lines = LineWriter(folder.path / "records" / f"000{number}-gw0.jsonl", head)
        lines.append(asdict(record(planned[20 + number].id, max_dev=(("gas", 0.5),))))
        lines.close()

        @contextmanager
        def written(path: Path, stop: str = killed_before) -> Iterator[Path]:
            with writing_temporary_path(path) as temporary:
                yield temporary
                if path.name == stop:
                    raise KeyboardInterrupt

        with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
            patch.setattr(table_building, "writing_temporary_path", written)
            table_building.ensure_tables(folder.path)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        table_building.ensure_tables(folder.path)
    assert (folder.path / table_building.CSV_FILE).read_bytes().count(b"\n") == 25
