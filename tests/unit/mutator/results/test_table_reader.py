"""The module through which all others read the results of a run."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

import mutator
from mutator.comparison.compared_runs import load_compared_run
from mutator.errors import MutatorError
from mutator.execution.single_run import run_single
from mutator.exports import Format
from mutator.exports.run_export import export
from mutator.model import Experiment, Outcome, Status
from mutator.report import report_builder
from mutator.results import table_building
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.outcome_counting import checked_hazard_names as checked_hazards
from mutator.results.severity_and_sentence_columns import SEVERITY_COLUMN, TIME_TO_HAZARD_COLUMNS
from mutator.results.table_columns import (
    cells_by_column,
    hazard_names_of_frame,
    result_columns,
    result_columns_of,
)
from mutator.results.table_reader import Results, _load_columns, frame_of_experiments, is_same_parquet
from mutator.statistics.results_frame import hazard_names, load_usable_results, prepare_results
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.targets.process_environment import THREAD_VARIABLES
from mutator.targets.stored_target_facts import metric_facts
from mutator.workspace import Workspace
from tests.costs import is_cheap, is_refused

SOURCES = Path(mutator.__file__).parent
WriteRun = Callable[..., Path]
# Names of the toy car, and their replacements for another target.
OF_A_CRANE = {r"\bH1\b": "CRUSHED", r"\bH3\b": "DROPPED", r"\bgas\b": "winch", r"\bbrake\b": "clamp"}


@pytest.fixture
def crane(toycar: Workspace) -> Workspace:
    """The toy with other names for hazards and channels."""
    for path in toycar.library.parent.rglob("*"):
        if path.suffix in (".py", ".yaml") and "templates" not in path.parts:
            text = path.read_text()
            for old, new in OF_A_CRANE.items():
                text = re.sub(old, new, text)
            path.write_text(text)
    return toycar


def became(e: Experiment) -> dict[str, Any] | None:
    if e.fault.fault_type == "silence":
        return {"status": Status.CRASHED, "outcome": None, "max_dev": ()}
    hazard = {"outcome": Outcome.HAZARD, "hazards": (("DROPPED", 4.0), ("CRUSHED", 4.5))}
    return hazard if e.fault.fault_type == "lane" else {}


@pytest.fixture
def run(crane: Workspace, tmp_path: Path, write_run: WriteRun) -> Path:
    return write_run(crane, tmp_path / "run", became)


ALONE = """
import sys
from pathlib import Path
from mutator.results.outcome_counting import checked_hazard_names as checked_hazards
from mutator.results.table_reader import Results, is_same_parquet
table = Results(Path(sys.argv[1]))
assert is_same_parquet(table.path, table.path)
table.frame(), table.indexed_frame(), table.timings(), table.propagation()
print(*(path.read_text().strip() for path in Path("/proc/self/task").glob("*/comm")))
"""


def test_reading_tables_leaves_no_thread(run: Path) -> None:
    """A pyarrow thread that releases Python memory during shutdown kills the process. Threads of the
    allocator and of BLAS do not use Python."""
    table_building.build_tables(run)
    words, env = [sys.executable, "-c", ALONE, str(run)], os.environ | dict.fromkeys(THREAD_VARIABLES, "1")
    ended = subprocess.run(words, capture_output=True, text=True, check=True, timeout=120, env=env)
    assert [name for name in ended.stdout.split() if name != "jemalloc_bg_thd"] == [ended.stdout.split()[0]]


def test_columns_follow_the_targets_hazards_and_channels(run: Path) -> None:
    table = Results.up_to_date(run)
    columns = table.csv().decode().partition("\n")[0].split(",")
    at = columns.index("t_manifest")
    assert columns[at + 1 : at + 7] == [
        "crushed",
        "t_crushed",
        "dropped",
        "t_dropped",
        "too_fast",
        "t_too_fast",
    ]
    at = columns.index("reaction_time")
    assert columns[at + 1 : at + 4] == ["max_dev_winch", "max_dev_clamp", "max_dev_wheel"]
    assert not [name for name in columns if re.search(r"h[123]\b|gas|brake|steer", name)]
    assert list(table.frame().columns) == columns
    frame = table.indexed_frame()
    assert [frame.index.name, *frame.columns][: len(columns)] == columns
    assert frame.attrs["units"]["max_dev_winch"] == "as its channel"


def test_numbers_have_the_units_of_their_metric_or_channel(
    crane: Workspace, tmp_path: Path, write_run: WriteRun
) -> None:
    path = crane.library / "targets" / "toycar.yaml"
    hazards = "hazards: {DROPPED: {when: speed > 90, terminal: true, unit: m/s}, "
    hazards += "CRUSHED: {when: speed > 91}, TOO_FAST: {when: speed > 92}}\n"
    metrics = "metrics: {way: {integral: speed, unit: m, worse: lower, about: x}}\n"
    path.write_text(re.sub("hazards: .*\n", hazards + metrics, path.read_text()))
    run = write_run(crane, tmp_path / "run", lambda e: {"hazards": ()})
    units = Results.up_to_date(run).indexed_frame().attrs["units"]
    assert (units["way"], units["margin_dropped"], units["t_end"]) == ("m", "m/s", "s")
    assert units["max_dev_winch"] == units["dev_winch"] == "as its channel"


def test_every_way_of_reading_gives_the_same_hazards(run: Path) -> None:
    table = Results.up_to_date(run)
    rows = table.rows()
    frame, statistics = (
        table.indexed_frame(),
        load_usable_results(run / "results.csv").set_index("experiment_id"),
    )
    assert [row.experiment_id for row in rows] == list(frame.index)
    assert load_compared_run(run).row_by_id == {row.experiment_id: row for row in rows}
    assert {row.hazards for row in rows} == {(), (("DROPPED", 4.0), ("CRUSHED", 4.5))}
    for row in rows:
        first = row.hazards[0][1] if row.hazards else None
        for time in (frame.loc[row.experiment_id, "t_hazard"], statistics.loc[row.experiment_id, "t_hazard"]):
            assert (None if pd.isna(time) else time) == first
        flags = frame.loc[row.experiment_id, ["crushed", "dropped", "too_fast"]]
        assert list(flags.notna()) == [row.status is Status.OK] * 3


def test_the_column_hazard_is_unknown_for_crashes(run: Path) -> None:
    frame = Results.up_to_date(run).indexed_frame()
    assert list(frame["hazard"].isna()) == list(frame["status"] == "crashed")
    assert frame["hazard"].isna().any()


def test_a_target_without_hazards_has_no_hazard_in_any_row(run: Path, reseal: Callable[[Path], None]) -> None:
    head = run / "run.json"
    head.write_text(re.sub(r'"hazards":\s*\[[^]]*\]', '"hazards": []', head.read_text()))
    reseal(run)
    table_building.build_tables(run)
    table = Results(run)
    frame = table.indexed_frame()
    assert frame["hazard"].dropna().eq(False).all()
    assert frame["hazard"].notna().any()
    assert frame["t_hazard"].dtype == float
    assert not load_usable_results(run / "results.csv")["is_hazard"].any()
    assert checked_hazards(table.frame()) == ()


def test_exports_and_the_report_use_the_names_of_the_target(run: Path, crane: Workspace) -> None:
    table = Results.up_to_date(run)
    assert export(run, Format.CSV).read_bytes() == table.csv()
    assert export(run, Format.PARQUET).read_bytes() == table.parquet()
    assert "hazard CRUSHED [s]" in export(run, Format.JUNIT).read_text()
    elements = export(run, Format.MUTATION_ELEMENTS, workspace=crane).read_text()
    assert "CRUSHED, DROPPED in" in elements
    text = report_builder.write_report(run, crane).markdown.read_text()
    assert "CRUSHED" in text
    assert "H1" not in text


def test_a_real_run_fills_each_column(crane: Workspace, tmp_path: Path, write_run: WriteRun) -> None:
    only = 'fault_type == "lane" and method == "random"'
    folder = write_run(crane, tmp_path / "one", lambda e: None, campaign="small", only=only, limit=1)
    [experiment] = plan_file.load_experiments(folder)
    manifest = crane.manifest("toycar")
    record = run_single(crane, manifest, experiment, tmp_path / "single").record
    assert record.status is Status.OK
    compared = [channel.name for channel in manifest.compared_channels]
    columns = result_columns(
        manifest.hazard_names, compared, metric_facts(manifest), (SEVERITY_COLUMN, *TIME_TO_HAZARD_COLUMNS)
    )
    cells = cells_by_column(columns, [FinishedExperiment(experiment, record, crane.scale_of(manifest))])
    row = {column.name: cell for column, (cell,) in zip(columns, cells, strict=True)}
    assert row["max_dev_wheel"]


def test_a_missing_table_is_reported(tmp_path: Path) -> None:
    table = Results(tmp_path)
    for read in (table.rows, table.csv, table.frame, table.indexed_frame):
        with pytest.raises(MutatorError, match=f"{tmp_path}: no results here"):
            read()


@pytest.mark.parametrize("data", [b"a,b\n1,2\n", b"", b"PAR1", b"PAR1\xffPAR1"])
def test_a_file_that_is_not_a_results_table_is_refused(run: Path, data: bytes) -> None:
    table = Results(run)
    table.path.write_bytes(data)
    for read in (table.rows, table.frame, table.indexed_frame):
        with pytest.raises(MutatorError, match="not a results table"):
            read()


@pytest.mark.parametrize("cut", [0.1, 0.5, 0.9])
def test_an_incomplete_table_is_refused(run: Path, cut: float) -> None:
    table = Results.up_to_date(run)
    whole = table.parquet()
    for damaged in (whole[: int(cut * len(whole))], whole[int(cut * len(whole)) :]):
        table.path.write_bytes(damaged)
        with pytest.raises(MutatorError, match="not a results table"):
            table.frame()


@pytest.mark.parametrize(
    ("name", "cell"), [("status", "melted"), ("status", None), ("outcome", "melted"), ("activated", 7)]
)
def test_an_impossible_cell_is_refused(run: Path, name: str, cell: object) -> None:
    """However the table is read, it is a mistake in the table and no defect of mutator."""
    table = Results.up_to_date(run)
    found = parquet.read_table(table.path)
    at = found.column_names.index(name)
    cells = pa.array([cell] * len(found), found.schema.field(at).type)
    parquet.write_table(found.set_column(at, name, cells), table.path)
    for read in (table.rows, table.frame, table.indexed_frame):
        with pytest.raises(MutatorError, match=f"not a results table: column '{name}' has the cell {cell!r}"):
            read()


@pytest.mark.parametrize(
    ("name", "cells", "why"),
    [
        ("status", pa.array([7]), "column 'status' has the type int64, not string"),
        ("t_alert", pa.array(["soon"]), "column 't_alert' has the type string, not double"),
        ("t_alert", pa.array([[1.0]]), "column 't_alert' has the type list<"),
        ("crushed", None, "no column 'crushed'"),
    ],
)
def test_a_column_of_another_type_is_refused(run: Path, name: str, cells: pa.Array | None, why: str) -> None:
    """The types are those of the columns of the run's target."""
    table = Results.up_to_date(run)
    found = parquet.read_table(table.path).slice(0, 1)
    at = found.column_names.index(name)
    parquet.write_table(
        found.remove_column(at) if cells is None else found.set_column(at, name, cells), table.path
    )
    for read in (table.rows, table.frame, table.indexed_frame):
        with pytest.raises(MutatorError, match=re.escape(why)):
            read()


def test_the_types_of_a_frame_are_those_of_the_table(run: Path) -> None:
    """A text without a value is ''; nothing is parsed from results.csv, which can be missing."""
    table = Results.up_to_date(run)
    (run / "results.csv").unlink()
    frame = table.frame()
    kinds = {c.name: frame[c.name].dtype for c in result_columns_of(RunFolder(run))}
    texts = {c.name for c in result_columns_of(RunFolder(run)) if c.type == "text"}
    assert {name for name, kind in kinds.items() if kind == "str"} == texts
    assert all(kind.kind in "if" for name, kind in kinds.items() if name not in texts)
    assert set(frame["alerts"]) == {""} and frame["t_alert"].isna().all()
    assert list(table.frame("status", "outcome").columns) == ["status", "outcome"]


def test_a_frame_computed_from_records_equals_the_stored_one(run: Path) -> None:
    """Without the columns of the fault's path, which take longest."""
    folder = RunFolder.open(run)
    stored, computed = (
        Results.up_to_date(run).frame(),
        frame_of_experiments(folder, plan_file.load_experiments(run)),
    )
    names = [name for name in stored if name not in ("reached", "stopped_at")]
    computed = computed.sort_values("experiment_id", ignore_index=True)
    pd.testing.assert_frame_equal(computed[names], stored[names])
    assert hazard_names_of_frame(computed) == hazard_names_of_frame(stored)


def test_no_other_module_opens_the_tables() -> None:
    allowed = {"results/table_reader.py", "outcomes/importers/csv.py", "outcomes/importers/parquet.py"}
    opens = re.compile(r"read_csv|read_parquet|read_table\(|ParquetFile")
    named = re.compile(r"results\.(csv|parquet)\"\)?\.(open|read_)|open\([^)]*results\.(csv|parquet)")
    found = {
        path.relative_to(SOURCES).as_posix()
        for path in SOURCES.rglob("*.py")
        if opens.search(path.read_text()) or named.search(path.read_text())
    }
    assert found == allowed


def test_metadata_of_a_table_give_no_column_another_name(run: Path) -> None:
    """The cells of the forged table are the genuine ones."""
    table_building.build_tables(run)
    path = run / "results.parquet"
    genuine, table = Results(run).frame(), parquet.read_table(path)
    swap = {"DROPPED": "CRUSHED", "CRUSHED": "DROPPED"}
    columns = [
        {"name": swap.get(n, n), "field_name": n, "pandas_type": "", "numpy_type": "", "metadata": None}
        for n in table.column_names
    ]
    about = {"index_columns": [], "column_indexes": [], "columns": columns, "pandas_version": "2.2.0"}
    forged = path.with_name("forged.parquet")
    parquet.write_table(table.replace_schema_metadata({"pandas": json.dumps(about)}), forged)
    assert not is_same_parquet(forged, path)
    forged.replace(path)
    assert Results(run).frame().equals(genuine)


def _bomb(path: Path, rows: int, length: int) -> None:
    """Write a small file in which a long text, stored once, is in each row."""
    text = pa.DictionaryArray.from_arrays(pa.array([0] * rows, pa.int32()), pa.array(["x" * length]))
    parquet.write_table(pa.table({"a": text}), path, compression="zstd", store_schema=False)


def test_a_long_text_that_is_stored_once_is_not_copied_into_each_row(tmp_path: Path) -> None:
    path, genuine = tmp_path / "results.parquet", tmp_path / "genuine.parquet"
    _bomb(path, 20_000, 50_000)
    _bomb(genuine, 20_000, 5)
    assert path.stat().st_size < 10_000
    assert "bytes of text" in is_refused(lambda: _load_columns(path))
    is_cheap(lambda: is_same_parquet(path, genuine))
    assert not is_same_parquet(path, genuine) and is_same_parquet(genuine, genuine)


def test_hazards_have_the_names_of_run_json(run: Path, reseal: Callable[[Path], None]) -> None:
    """The columns tell neither how a hazard is spelt, nor a hazard from a pair of metrics `x` and `t_x`."""
    head = run / "run.json"
    facts = json.loads(head.read_text())
    metrics = [[name, "-", "-", "lower"] for name in ("way", "t_way")]
    head.write_text(json.dumps(facts | {"hazards": ["Dropped", "CRUSHED"], "metrics": metrics}))
    reseal(run)
    table_building.build_tables(run)
    table = Results(run)
    assert checked_hazards(table.frame()) == ("CRUSHED", "Dropped")
    assert (
        hazard_names_of_frame(table.frame())
        == hazard_names_of_frame(table.indexed_frame())
        == ("Dropped", "CRUSHED")
    )
    assert hazard_names(load_usable_results(table.path)) == ("CRUSHED", "Dropped")
    assert "way" in table.frame()


def test_a_table_without_a_hazard_of_run_json_is_refused(run: Path) -> None:
    table = Results.up_to_date(run)
    head = run / "run.json"
    head.write_text(head.read_text().replace("CRUSHED", "BROKEN"))
    for read in (table.rows, table.frame, table.indexed_frame):
        with pytest.raises(MutatorError, match="no column 'broken'"):
            read()


def test_a_frame_without_its_hazards_is_refused(run: Path) -> None:
    """Pandas keeps them in frames made from a frame of a run, but another frame has none."""
    frame = Results.up_to_date(run).frame()
    assert hazard_names_of_frame(
        frame[frame["status"] == "ok"].reset_index(drop=True)
    ) == hazard_names_of_frame(frame)
    with pytest.raises(MutatorError, match="without the names of its hazards"):
        prepare_results(pd.DataFrame(frame.to_dict("list")))
