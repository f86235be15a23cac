"""The spread between seeds, for frames made by hand."""

import math
from math import nan
from typing import Any

import numpy as np
import pytest

from mutator.statistics.seed_spread_tables import seeds_by_fault_type_sheet, seeds_of, seeds_sheet
from mutator.statistics.statistics_sheet import Sheet

from .results_frame import results

COLUMNS = ("share", "low", "high", "least", "its", "largest", "other", "seeds")


def seed(number: int, hazards: int, runs: int = 10, **more: Any) -> list[dict[str, Any]]:
    ran = {"seed": number, "t_activation": 1.0, **more}
    return [ran | ({"h1": 1, "t_h1": 2.0} if i < hazards else {}) for i in range(runs)]


def cells(sheet: Sheet, *names: str) -> dict[str, Any]:
    [line] = [line for line in sheet.lines if line[:3] == names]
    return dict(zip(COLUMNS, line[3:], strict=True))


def test_one_seed_has_no_spread() -> None:
    frame = results(*seed(7, 3))
    assert seeds_sheet(frame).lines == seeds_by_fault_type_sheet(frame).lines == ()


def test_the_lowest_and_the_highest_seed_are_shown() -> None:
    frame = results(*seed(10, 1), *seed(9, 6, runs=20), *seed(2, 5), *seed(30, 1))
    assert seeds_of(frame) == ["2", "9", "10", "30"]
    found = cells(seeds_sheet(frame), "all", "hazards", "activated")
    assert (found["share"].count, found["share"].of, found["seeds"]) == (13, 50, 4)
    assert (found["least"], found["its"], found["largest"], found["other"]) == (0.1, 10, 0.5, 2)
    assert cells(seeds_sheet(frame), "all", "H1", "injected") == found  # no other hazard occurred


def test_the_interval_is_made_of_percentiles_of_resampled_seeds() -> None:
    """Two draws from the shares 0.2 and 0.6 have the mean 0.2, 0.4, 0.4 or 0.6, so the interval is 0.2 to
    0.6."""
    found = cells(seeds_sheet(results(*seed(1, 2), *seed(2, 6))), "all", "hazards", "activated")
    assert (found["low"], found["high"]) == pytest.approx((0.2, 0.6))
    hazards = [(7 * k) % 10 for k in range(20)]
    frame = results(*(row for k, count in enumerate(hazards) for row in seed(k, count)))
    found = cells(seeds_sheet(frame), "all", "hazards", "activated")
    means = np.random.default_rng(5).choice(hazards, size=(20_000, 20)).mean(axis=1) / 10
    assert (found["low"], found["high"]) == pytest.approx(tuple(np.quantile(means, (0.025, 0.975))), abs=0.01)
    again = cells(seeds_sheet(frame), "all", "hazards", "activated")
    assert again == found  # the draws are seeded


def test_seeds_that_agree_have_no_interval() -> None:
    frame = results(*seed(1, 4), *seed(2, 4), *seed(3, 0, t_activation=nan))
    found = cells(seeds_sheet(frame), "all", "hazards", "activated")
    assert math.isnan(found["low"]) and math.isnan(found["high"])
    assert (found["seeds"], found["least"], found["largest"]) == (2, 0.4, 0.4)
    activated = cells(seeds_sheet(frame), "all", "activated", "injected")
    assert (activated["least"], activated["its"], activated["seeds"]) == (0.0, 3, 3)


def test_each_method_and_fault_type_has_separate_lines() -> None:
    frame = results(
        *seed(1, 2), *seed(2, 3), *seed(1, 8, method="random"), *seed(2, 9, method="random", fault_type="fog")
    )
    sheet = seeds_sheet(frame, has_alerts=False)
    assert {line[0] for line in sheet.lines} == {"all", "guided", "random"}
    assert not [line for line in sheet.lines if "alert" in str(line[1])]
    assert cells(sheet, "random", "hazards", "injected")["largest"] == 0.9
    assert {line[0] for line in seeds_by_fault_type_sheet(frame).lines} == {"radar/chaff", "radar/fog"}
    assert cells(seeds_by_fault_type_sheet(frame), "radar/fog", "hazards", "injected")["seeds"] == 1
