"""Tables of metrics, severity and times to the hazard."""

import math

import numpy as np
import pandas as pd
import pytest

from mutator.statistics import bootstrap_median_intervals
from mutator.statistics.bootstrap_median_intervals import median_difference, median_interval
from mutator.statistics.metric_and_severity_tables import (
    metrics_sheet,
    severity_by_fault_type_sheet,
    times_to_hazard_sheet,
)
from mutator.targets.stored_target_facts import MetricFacts

METRICS = [
    MetricFacts("t_end", "s", "x", "lower"),
    MetricFacts("gap", "m", "x", "lower"),
    MetricFacts("speed", "m/s", "x", "higher"),
]
FRAME = pd.DataFrame(
    {
        "kind": ["a/x"] * 5 + ["a/y", "a/y"],
        "fault_id": [*"fghij", "k", "k"],
        "is_activated": [True] * 6 + [False],
        "t_end": [math.nan] * 7,
        "gap": [1.0, 2, 3, 4, 5, math.nan, 0],
        "speed": [5.0, 6, 7, 8, 9, 4, 99],
        "severity": ["S3", "S2", "", "", "S0", "", "S3"],
        "is_hazard": [True] * 5 + [False, False],
        "t_activation": [1.0, 1, 1, 1, 1, 1, math.nan],
        "t_manifest": [1.5, 9, math.nan, 2, 2, 2, math.nan],
        "t_alert": [math.nan, 2.0, 4, 1, 7, math.nan, math.nan],
        "t_hazard": [2.0, 3, 4, 5, 6, math.nan, math.nan],
    }
)
FRAME.attrs["hazards"] = ()


def test_each_metric_has_its_spread_by_fault_type() -> None:
    sheet = metrics_sheet(FRAME, METRICS)
    told = [(*line[:6], *line[8:]) for line in sheet.lines]
    assert told == [
        ("a/x", "gap", "m", "lower", 5, 3.0, 2.0, 1.0),
        ("a/x", "speed", "m/s", "higher", 5, 7.0, 8.0, 9.0),
        ("a/y", "speed", "m/s", "higher", 1, 4.0, 4.0, 4.0),
        ("total", "speed", "m/s", "higher", 6, 6.5, 7.75, 9.0),
    ]
    assert [line[6:8] for line in sheet.lines[:2]] == [(1.0, 5.0), (5.0, 9.0)]
    assert all(math.isnan(cell) for cell in sheet.lines[2][6:8] if isinstance(cell, float))  # one run only


def test_without_values_there_is_no_table() -> None:
    frame = FRAME[FRAME["kind"] == "a/y"]
    assert metrics_sheet(frame, []).lines == ()
    assert times_to_hazard_sheet(frame, frame["is_hazard"]).lines == ()
    assert severity_by_fault_type_sheet(frame.drop(columns="severity")).lines == ()


def test_severity_classes_are_counted_by_fault_type() -> None:
    rows = severity_by_fault_type_sheet(FRAME).table().rows
    counts = [[row[0], *(cell.partition("(")[2].partition(";")[0] for cell in row[1:])] for row in rows]
    assert counts == [
        ["a/x", "3/5", "1/5", "0/5", "1/5", "1/5"],
        ["a/y", "0/1", "0/1", "0/1", "0/1", "0/1"],
        ["total", "3/6", "1/6", "0/6", "1/6", "1/6"],
    ]
    assert rows[0][1] == "60.0 % (3/5; 23.1 to 88.2)"


def test_times_to_a_hazard_need_an_earlier_event() -> None:
    """The bound of the FTTI has only runs whose fault still acted."""
    still_active = pd.Series([False, True, False, True, True, False, False])
    told = [line[:6] for line in times_to_hazard_sheet(FRAME, still_active).lines]
    assert told == [
        ("a/x", "activation to hazard", 5, 1.0, 2.0, 3.0),
        ("a/x", "activation to hazard, fault still active", 3, 2.0, 3.0, 4.0),
        ("a/x", "manifestation to hazard", 3, 0.5, 1.75, 3.0),
        ("a/x", "alert to hazard", 2, 1.0, 1.75, 2.5),
    ]
    assert len(times_to_hazard_sheet(FRAME, still_active, has_alerts=False).lines) == 3


def test_the_note_on_times_says_what_the_bound_of_the_ftti_covers() -> None:
    """A reader can see that lines mix hazards, that warned runs count, and that a hazard can be late."""
    note = times_to_hazard_sheet(FRAME, FRAME["is_hazard"]).note
    for words in ("one hazardous event", "covers all hazards", "an alert came", "later than the hazardous"):
        assert words in note


@pytest.mark.parametrize("pairs", [False, True])
def test_the_interval_of_a_median_resamples_whole_faults(
    pairs: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A simple loop that copies the runs of each drawn fault gives the same interval."""
    monkeypatch.setattr(bootstrap_median_intervals, "RESAMPLE_COUNT", 40)
    monkeypatch.setattr(
        bootstrap_median_intervals, "_MOST_BATCH_CELLS", 300
    )  # the draws need several batches
    rng = np.random.default_rng(3)
    cluster = pd.Series(rng.integers(0, 6, 30))
    first, second = pd.Series(rng.normal(0, 1, 30)), pd.Series(rng.normal(1, 1, 30).round(1))
    draws, names = np.random.default_rng(1), cluster.unique()
    seen = []
    for counts in draws.multinomial(6, [1 / 6] * 6, size=40):
        of = zip(names, counts, strict=True)
        rows = [i for name, n in of for i in cluster.index[cluster == name].repeat(n)]
        seen.append(np.median(second[rows]) - (np.median(first[rows]) if pairs else 0.0))
    expected = pytest.approx(tuple(np.quantile(seen, (0.025, 0.975))))
    if pairs:
        found = median_difference(first, second, cluster)
        assert found.difference == np.median(second) - np.median(first)
        assert (found.low, found.high) == expected
    else:
        assert median_interval(second, cluster) == expected


def test_a_median_of_one_fault_or_of_equal_runs_has_no_interval() -> None:
    ones, faults = pd.Series([1.0, 1.0, 1.0]), pd.Series(["a", "b", "c"])
    assert all(map(math.isnan, median_interval(ones, faults)))
    assert all(map(math.isnan, median_interval(pd.Series([1.0, 2.0]), pd.Series(["a", "a"]))))
    same = median_difference(faults.index.to_series(), faults.index.to_series() + 2, faults)
    assert same.difference == 2.0
    assert math.isnan(same.low)
    assert math.isnan(median_difference(ones[:0], ones[:0], faults[:0]).difference)
