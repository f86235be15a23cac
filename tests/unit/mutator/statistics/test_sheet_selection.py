"""All tables of a run."""

import math

from mutator.statistics.sheet_selection import run_sheets
from mutator.statistics.statistics_sheet import PValue, Sheet

from .results_frame import results

GUIDED = {"t_activation": 7.0, "alerts": "fcw", "t_alert": 8.0, "t_h1": 9.0, "h1": 1}
RANDOM = GUIDED | {"method": "random", "trigger": "random/C2"}
ALERTS = {"0": (("fcw", 8.0),), "1": ()}


def test_a_run_of_both_methods_has_all_tables() -> None:
    expected = [
        *("summary_guided", "summary_random", "coverage_guided", "coverage_random"),
        *("guided_against_random", "guided_against_random_by_fault_type", "matched_pairs"),
        *("propagation", "alert_to_hazard", "alerts_before_hazards", "hazard_orders"),
    ]
    frame = results(GUIDED, RANDOM)
    assert [sheet.name for sheet in run_sheets(frame, None, ALERTS, {"S1": 30.0})] == expected
    expected.remove("alerts_before_hazards")
    assert [sheet.name for sheet in run_sheets(frame, None, {}, {"S1": 30.0})] == expected
    expected.remove("alert_to_hazard")
    assert [sheet.name for sheet in run_sheets(frame, None, {}, None)] == expected


def test_one_method_without_published_numbers_has_only_counts() -> None:
    assert run_sheets(results(GUIDED), None, {}, {"S1": 30.0}) == ()


def test_numbers_are_written_plainly() -> None:
    sheet = Sheet(
        name="n", title="T", note="N.", heads=("a", "b", "c"), lines=((math.nan, PValue(1e-20), None),)
    )
    assert sheet.table().rows == [["-", "< 0.0001", "-"]]
    assert sheet.as_csv() == "a,b,c\n,1e-20,\n"
