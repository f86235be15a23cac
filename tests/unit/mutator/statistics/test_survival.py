"""Censored times agree with lifelines 0.30.3, with published curves, and with a median computed by hand."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.stats import CensoredData, ecdf

from mutator.statistics import event_time_statistics
from mutator.statistics.event_time_statistics import AlertToHazardTimes

from .results_frame import results

LIFELINES: dict[str, dict[str, Any]] = json.loads(
    Path(__file__).with_name("survival_by_lifelines.json").read_text()
)["samples"]
FLAT = {"flat at one half": 1.165, "flat at one half, censored": 2.5}
ALERT_S = 5.0


def reaction(sample: dict[str, Any], driver_s: float = 1.8) -> AlertToHazardTimes:
    """Reaction times of runs with an alert at 5 s, followed by a hazard or by the end of the scenario."""
    rows, ends = [], {}
    for i, (time, event) in enumerate(zip(sample["times"], sample["status"], strict=True)):
        ends[f"S{i}"] = ALERT_S + time
        row = {"scenario": f"S{i}", "t_activation": 1.0, "t_alert": ALERT_S, "alerts": "fcw"}
        rows.append(row | ({"t_h1": ALERT_S + time} if event else {}))
    return event_time_statistics.alert_to_hazard_times(results(*rows), ends, driver_s)


@pytest.mark.parametrize("sample", LIFELINES.values(), ids=LIFELINES)
def test_the_curve_equals_that_of_lifelines(sample: dict[str, Any]) -> None:
    found = [reaction(sample, at).no_hazard_share for at in sample["at"]]
    assert found == pytest.approx(sample["survival"], abs=1e-12)
    assert reaction(sample, sample["at"][0] / 2).no_hazard_share == 1.0


@pytest.mark.parametrize(("name", "sample"), LIFELINES.items(), ids=LIFELINES)
def test_the_median_equals_that_of_lifelines_except_for_flat_halves(
    name: str, sample: dict[str, Any]
) -> None:
    """If the curve stays at one half for some time, lifelines returns the beginning of that time, and the
    report its middle."""
    found = reaction(sample)
    assert (found.runs_alerted_first, found.hazards_after_alert) == (
        len(sample["times"]),
        sum(sample["status"]),
    )
    if name in FLAT:
        assert sample["median"] < found.median_s == pytest.approx(FLAT[name])
    else:
        assert found.median_s == pytest.approx(_finite(sample["median"]), nan_ok=True)


@pytest.mark.parametrize("sample", LIFELINES.values(), ids=LIFELINES)
def test_the_interval_of_the_median_equals_that_of_lifelines(sample: dict[str, Any]) -> None:
    """The interval consists of the times at which lifelines' interval of the curve contains one half. Where
    the curve is 0, lifelines uses (0, 0), so its interval ends there. The report leaves the interval open, as
    R does."""
    found = reaction(sample)
    high = sample["median_high"]
    if high == sample["at"][-1] and sample["survival"][-1] == 0.0:
        high = math.inf
    if math.isnan(found.median_low_s):  # the interval of the curve never contains one half
        assert min(sample["low"]) > 0.5 and math.isnan(found.median_high_s)
    else:
        assert found.median_low_s == pytest.approx(sample["median_low"])
        assert found.median_high_s == (high if math.isinf(high) else pytest.approx(high))


def test_the_published_curve_of_freireich() -> None:
    """The curve for 6-MP and the medians are in Kleinbaum and Klein, Survival Analysis: A Self-Learning Text,
    chapter 2."""
    drug, placebo = LIFELINES["6-MP"], LIFELINES["placebo"]
    curve = [round(reaction(drug, week).no_hazard_share, 3) for week in (6, 7, 10, 13, 16, 22, 23)]
    assert curve == [0.857, 0.807, 0.753, 0.690, 0.627, 0.538, 0.448]
    assert (reaction(drug).median_s, reaction(placebo).median_s) == (23.0, 8.0)


def test_the_published_medians_of_miller() -> None:
    """R's `survfit` prints these medians, with and without maintenance, for its data set `aml`."""
    medians = [reaction(LIFELINES[name]).median_s for name in ("maintained", "not maintained")]
    assert medians == [31.0, 23.0]


@pytest.mark.parametrize("size", [1, 2, 3, 4, 20, 21, 50, 51])
def test_without_censoring_the_median_is_the_usual_one(size: int) -> None:
    drawn = np.random.default_rng(size).uniform(0.5, 9.0, size).round(3)
    sample = {"times": drawn, "status": [1] * size}
    assert reaction(sample).median_s == pytest.approx(np.median(drawn))


def test_a_curve_that_ends_at_one_half_has_its_median_at_that_step() -> None:
    assert reaction(LIFELINES["one half to the end"]).median_s == 2.0


@pytest.mark.parametrize("name", ["ties", "large"])
def test_the_curve_equals_that_of_scipy(name: str) -> None:
    sample = LIFELINES[name]
    frame = pd.DataFrame({"time": sample["times"], "event": sample["status"]})
    known, cut = frame[frame["event"] == 1]["time"], frame[frame["event"] == 0]["time"]
    curve = ecdf(CensoredData(uncensored=known, right=cut)).sf
    band = curve.confidence_interval(0.95, method="log-log")
    assert curve.evaluate(sample["at"]) == pytest.approx(sample["survival"], abs=1e-12)
    assert band.low.evaluate(sample["at"]) == pytest.approx(sample["low"], abs=1e-12)
    found = reaction(sample)
    steps = curve.quantiles
    inside = steps[(band.low.probabilities <= 0.5) & (band.high.probabilities >= 0.5)]
    assert found.median_low_s == pytest.approx(inside.min())
    assert found.median_high_s == pytest.approx(min(step for step in sample["at"] if step > inside.max()))


def _finite(value: float) -> float:
    return math.nan if math.isinf(value) else value
