"""Counts of the experiments in the results table."""

import csv
from pathlib import Path

import pytest

from mutator.model import Outcome, Status
from mutator.results.column_facts import result_columns
from mutator.results.counting import counts_by, hazard_names, kinds, outcome_counts
from mutator.results.rows import count_table
from mutator.results.table_reader import Results

COLUMNS = [column.name for column in result_columns(("H1", "H2", "H3"), ("gas",))]
SEEN = {
    "module": "radar",
    "fault_type": "chaff",
    "scenario": "S1",
    "method": "guided",
    "status": "ok",
    "outcome": "sdc",
    "t_activation": "7.0",
    "t_manifest": "7.1",
    "h1": "0",
    "h2": "0",
    "h3": "0",
}


def write_table(path: Path, *lines: dict[str, str]) -> Path:
    path.with_name("run.json").write_text('{"schema": "run/3", "hazards": ["H1", "H2", "H3"]}')
    with path.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, COLUMNS, restval="")
        table.writeheader()
        for i, line in enumerate(lines):
            table.writerow({"experiment_id": f"{i:016x}"} | line)
    return path


def test_one_row_of_each_kind_is_counted_once(tmp_path: Path) -> None:
    hazard = SEEN | {"outcome": "hazard", "h1": "1", "t_h1": "18.3", "alerts": ""}
    warned = hazard | {"alerts": "can_error;fcw", "t_alert": "7.2", "h3": "1", "t_h3": "19.0"}
    idle = {k: v for k, v in SEEN.items() if not k.startswith("t_")} | {"outcome": "not_activated"}
    masked = SEEN | {"outcome": "masked", "t_manifest": ""}
    rows = Results(write_table(tmp_path / "results.csv", SEEN, hazard, warned, idle, masked)).texts()

    [chaff, total] = counts_by(rows, kinds(rows))

    assert (chaff.injected, chaff.activated, chaff.manifested) == (5, 4, 3)
    assert chaff.hazards == (2, 0, 1)
    assert (chaff.any_hazard, chaff.alerts, chaff.hazards_without_alert) == (2, 1, 1)
    assert total.injected == 5
    assert outcome_counts(rows) == {"not_activated": 1, "masked": 1, "sdc": 1, "hazard": 2}


@pytest.mark.parametrize("status", [Status.HARNESS_ERROR, Status.INVALID_MUTANT])
def test_unusable_experiments_are_counted_separately(tmp_path: Path, status: Status) -> None:
    bad = SEEN | {"status": status.value, "outcome": "", "t_h1": "3.0", "alerts": "fcw"}
    rows = Results(write_table(tmp_path / "results.csv", SEEN, bad)).texts()

    [count, _] = counts_by(rows, kinds(rows))

    assert (count.injected, count.activated, count.any_hazard, count.alerts) == (1, 1, 0, 0)
    assert count.unusable == 1
    assert outcome_counts(rows) == {"sdc": 1, status.value: 1}


@pytest.mark.parametrize("status", [Status.CRASHED, Status.TIMEOUT])
def test_a_crash_is_counted_as_injected_and_in_its_own_column(tmp_path: Path, status: Status) -> None:
    bad = SEEN | {"status": status.value, "outcome": "", "t_manifest": ""}
    rows = Results(write_table(tmp_path / "results.csv", SEEN, bad)).texts()

    heads, lines = count_table(counts_by(rows, kinds(rows)), "fault type", hazard_names(rows))

    assert heads[-1] == status.value
    assert lines[-1][heads.index("injected")] == "2"
    assert lines[-1][-1] == "1"


def test_failure_columns_appear_only_if_a_run_failed(tmp_path: Path) -> None:
    rows = Results(write_table(tmp_path / "results.csv", SEEN)).texts()
    heads, _ = count_table(counts_by(rows, kinds(rows)), "fault type", hazard_names(rows))
    assert heads[-1] == "hazard, no alert"


def test_hazards_that_a_target_does_not_check_are_left_out(tmp_path: Path) -> None:
    seen = SEEN | {"h1": "", "h2": "0", "h3": ""}
    assert hazard_names(Results(write_table(tmp_path / "results.csv", seen, seen)).texts()) == ("H2",)


def test_cells_are_converted_to_typed_values(tmp_path: Path) -> None:
    line = SEEN | {
        "outcome": "hazard",
        "h1": "1",
        "t_h1": "18.5",
        "h3": "1",
        "t_h3": "11.25",
        "alerts": "fcw;can_error",
    }
    [row] = Results(write_table(tmp_path / "results.csv", line)).rows()
    assert row.outcome is Outcome.HAZARD
    assert row.hazards == (("H3", 11.25), ("H1", 18.5))
    assert row.alerts == ("fcw", "can_error")
    assert row.reaction_time is None
