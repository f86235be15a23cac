"""Metrics as a table."""

import pandas as pd

from mutator.statistics.metric_tables import metrics_sheet

METRICS = [["t_end", "s", "x", "lower"], ["gap", "m", "x", "lower"], ["speed", "m/s", "x", "higher"]]


def test_the_spread_of_each_metric_by_fault_type() -> None:
    """Median, worse quartile and worst are by hand; what was not activated and what has no value is out."""
    frame = pd.DataFrame(
        {
            "kind": ["a/x"] * 5 + ["a/y", "a/y"],
            "is_activated": [True] * 6 + [False],
            "t_end": [None] * 7,
            "gap": ["1", "2", "3", "4", "5", "", "0"],
            "speed": ["5", "6", "7", "8", "9", "4", "99"],
        }
    )
    sheet = metrics_sheet(frame, METRICS)
    assert sheet.lines == (
        ("a/x", "gap", "m", "lower", 5, 3.0, 2.0, 1.0),
        ("a/x", "speed", "m/s", "higher", 5, 7.0, 8.0, 9.0),
        ("a/y", "speed", "m/s", "higher", 1, 4.0, 4.0, 4.0),
    )


def test_without_a_value_there_is_no_line() -> None:
    """A target without metrics, or a run without values, has no such table."""
    assert metrics_sheet(pd.DataFrame({"kind": ["a"], "is_activated": [True]}), []).lines == ()
