"""Counts of the experiments in the results table."""

import json
from pathlib import Path

import pytest

from mutator.model import Outcome, Status
from mutator.results.outcome_counting import (
    checked_hazard_names,
    count_by_outcome_or_status,
    count_outcomes_by_group,
    count_table,
    fault_types_of,
)
from mutator.results.severity_and_sentence_columns import TIME_TO_HAZARD_COLUMNS
from mutator.results.table_columns import result_columns
from mutator.results.table_reader import Results
from mutator.store import plan_file
from tests.made_head import made_head
from tests.made_up_results import write_results

COLUMNS = result_columns(("H1", "H2", "H3"), ("gas",), (), TIME_TO_HAZARD_COLUMNS)
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


def results(run: Path, *lines: dict[str, str]) -> Results:
    (run / "run.json").write_text(json.dumps(made_head(compared=["gas"])))
    plan_file.write_plan(run, [], [])
    named = ({"experiment_id": f"{i:016x}", "fault_id": "f"} | line for i, line in enumerate(lines))
    write_results(run, COLUMNS, named)
    return Results(run)


def test_one_row_of_each_kind_is_counted_once(tmp_path: Path) -> None:
    hazard = SEEN | {"outcome": "hazard", "h1": "1", "t_h1": "18.3", "alerts": ""}
    warned = hazard | {"alerts": "can_error;fcw", "t_alert": "7.2", "h3": "1", "t_h3": "19.0"}
    idle = {k: v for k, v in SEEN.items() if not k.startswith("t_")} | {"outcome": "not_activated"}
    masked = SEEN | {"outcome": "masked", "t_manifest": ""}
    rows = results(tmp_path, SEEN, hazard, warned, idle, masked).frame()

    [chaff, total] = count_outcomes_by_group(rows, fault_types_of(rows))

    assert (chaff.injected, chaff.activated, chaff.manifested) == (5, 4, 3)
    assert chaff.hazards == (2, 0, 1)
    assert (chaff.any_hazard, chaff.alerts, chaff.hazards_without_alert) == (2, 1, 1)
    assert total.injected == 5
    assert count_by_outcome_or_status(rows) == {"not_activated": 1, "masked": 1, "sdc": 1, "hazard": 2}


@pytest.mark.parametrize("status", [Status.HARNESS_ERROR, Status.INVALID_MUTANT])
def test_unusable_experiments_are_counted_separately(tmp_path: Path, status: Status) -> None:
    bad = SEEN | {"status": status.value, "outcome": "", "t_h1": "3.0", "alerts": "fcw"}
    rows = results(tmp_path, SEEN, bad).frame()

    [count, _] = count_outcomes_by_group(rows, fault_types_of(rows))

    assert (count.injected, count.activated, count.any_hazard, count.alerts) == (1, 1, 0, 0)
    assert count.unusable == 1
    assert count_by_outcome_or_status(rows) == {"sdc": 1, status.value: 1}


@pytest.mark.parametrize("status", [Status.CRASHED, Status.TIMEOUT])
def test_a_crash_is_counted_as_injected_and_in_its_own_column(tmp_path: Path, status: Status) -> None:
    bad = SEEN | {"status": status.value, "outcome": "", "t_manifest": ""}
    rows = results(tmp_path, SEEN, bad).frame()

    heads, lines = count_table(
        count_outcomes_by_group(rows, fault_types_of(rows)), "fault type", checked_hazard_names(rows)
    )

    assert heads[-1] == status.value
    assert lines[-1][heads.index("injected")] == "2"
    assert lines[-1][-1] == "1"


def test_failure_columns_appear_only_if_a_run_failed(tmp_path: Path) -> None:
    rows = results(tmp_path, SEEN).frame()
    heads, _ = count_table(
        count_outcomes_by_group(rows, fault_types_of(rows)), "fault type", checked_hazard_names(rows)
    )
    assert heads[-1] == "hazard, no alert"


def test_hazards_that_a_target_does_not_check_are_left_out(tmp_path: Path) -> None:
    seen = SEEN | {"h1": "", "h2": "0", "h3": ""}
    assert checked_hazard_names(results(tmp_path, seen, seen).frame()) == ("H2",)


def test_cells_are_converted_to_typed_values(tmp_path: Path) -> None:
    line = SEEN | {
        "outcome": "hazard",
        "h1": "1",
        "t_h1": "18.5",
        "h3": "1",
        "t_h3": "11.25",
        "alerts": "fcw;can_error",
    }
    [row] = results(tmp_path, line).rows()
    assert row.outcome is Outcome.HAZARD
    assert row.hazards == (("H3", 11.25), ("H1", 18.5))
    assert row.alerts == ("fcw", "can_error")
    assert row.reaction_time is None
