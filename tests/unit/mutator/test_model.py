"""Labels of faults and experiments in tables, messages and reports."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest

import mutator
from mutator.model import Experiment, Method, Record, Value, fault_label
from mutator.results.csv_and_parquet_writers import parquet_batch
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.result_rows import rows_of
from mutator.results.table_columns import cells_by_column, result_columns
from mutator.results.table_reader import typed_frame

SOURCES = Path(mutator.__file__).parent


@pytest.mark.parametrize(
    ("value", "unit", "label"),
    [
        (35, "m", "radar/chaff/distance 35 m"),
        (35.0, "m", "radar/chaff/distance 35.0 m"),
        ("35", "m", "radar/chaff/distance 35 m"),
        (0, "m", "radar/chaff/distance 0 m"),
        (-3, "-", "radar/chaff/distance -3"),
        ("left-", "-", "radar/chaff/distance left-"),
        ("left", "", "radar/chaff/distance left"),
        (False, "-", "radar/chaff/distance False"),
        (None, "m", "radar/chaff/distance"),
        ("", "-", "radar/chaff/distance"),
    ],
)
def test_the_label_of_a_fault_contains_its_value_and_unit(value: Value, unit: str, label: str) -> None:
    assert fault_label("radar/chaff/distance", value, unit) == label


@pytest.mark.parametrize("value", [35, 35.5, -0.0])
def test_a_fault_and_its_row_of_the_results_have_the_same_label(
    experiment: Callable[..., Experiment], record: Callable[..., Record], value: float
) -> None:
    """The table has 35.0 for both 35 and 35.0."""
    one = experiment(value=value)
    columns = result_columns((), ())
    cells = parquet_batch(columns, cells_by_column(columns, [FinishedExperiment(one, record(one.id))]))
    frame = typed_frame(pa.Table.from_batches([cells]), ())
    assert [row.fault for row in rows_of(frame, {one.fault.id: one.fault})] == [one.fault.label]


def test_the_label_of_an_experiment_names_its_fault_scenario_and_trigger(
    experiment: Callable[..., Experiment],
) -> None:
    assert experiment(value=35).label == "radar/chaff/distance 35 m, S1, guided C1"
    assert experiment(method=Method.RANDOM, trigger="random/C2").drive_label == "S1, random C2"


@pytest.mark.parametrize(
    ("method", "name", "expected"),
    [
        (Method.GUIDED, "C1", "S1, guided C1"),
        (Method.RANDOM, "random/C1", "S1, random C1"),
        (Method.GUIDED, "always", "S1, always"),
        (Method.GUIDED, "at 2 s", "S1, at 2 s"),
        (Method.GUIDED, "gap < 3", "S1, gap < 3"),
    ],
)
def test_only_a_context_is_called_guided(
    experiment: Callable[..., Experiment], method: Method, name: str, expected: str
) -> None:
    """A campaign that lists its triggers does not use the word."""
    trigger = replace(experiment().trigger, name=name, condition="gap < 3")
    assert replace(experiment(), method=method, trigger=trigger).drive_label == expected


def test_no_module_strips_a_placeholder_unit() -> None:
    """Only `fault_label` combines a value with its unit, so that a fault has one label in all tables."""
    assert [path for path in SOURCES.rglob("*.py") if '(" -")' in path.read_text()] == []
