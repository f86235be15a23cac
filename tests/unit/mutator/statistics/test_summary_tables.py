"""Summaries by scenario and fault type, and the frame that they use."""

import json
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.results.table_columns import result_columns
from mutator.statistics.results_frame import load_usable_results
from mutator.statistics.shares_with_intervals import share_with_interval
from mutator.statistics.summary_tables import coverage_sheet, summary_sheet
from mutator.statistics.tallies import Tally, tally_by_fault_type, tally_by_scenario
from tests.made_head import made_head
from tests.made_up_results import write_results

from .results_frame import results

HIT = {"t_activation": 7.0, "t_manifest": 7.1, "h1": 1, "t_h1": 18.0}


def test_wilson_interval_of_a_published_example() -> None:
    """The example is in Newcombe 1998, table I, method 3."""
    assert str(share_with_interval(81, 263)) == "30.8 % (81/263; 25.5 to 36.6)"
    assert share_with_interval(0, 20).low == 0
    assert str(share_with_interval(0, 0)) == "- (0/0)"


def test_a_table_without_published_counts_has_only_ours() -> None:
    coverage = coverage_sheet("guided", tally_by_fault_type(results(HIT)), None)
    assert [line[1] for line in coverage.lines] == ["here", "here"]
    summary = summary_sheet("guided", tally_by_scenario(results(HIT)), None)
    assert {line[2] for line in summary.lines} == {"here"}
    assert "paper" not in coverage.as_markdown() + summary.as_markdown()


def test_crashes_count_as_injected_and_harness_errors_do_not() -> None:
    frame = results(HIT, {"status": "harness_error"}, {"status": "invalid_mutant"}, {"status": "crashed"})
    assert tally_by_scenario(frame)["guided", "S1"] == Tally(
        injected=2,
        activated=1,
        manifested=1,
        hazards=1,
        alerts=0,
        hazards_no_alerts=1,
        alerts_no_hazards=0,
    )


def test_a_missing_file_or_column_is_reported(tmp_path: Path) -> None:
    with pytest.raises(MutatorError, match=r"results\.parquet"):
        load_usable_results(tmp_path / "results.csv")
    (tmp_path / "run.json").write_text(json.dumps(made_head(hazards=[])))
    columns = result_columns((), ())
    write_results(tmp_path, [column for column in columns if column.name != "module"], [])
    with pytest.raises(MutatorError, match="no column 'module'"):
        load_usable_results(tmp_path / "results.csv")
