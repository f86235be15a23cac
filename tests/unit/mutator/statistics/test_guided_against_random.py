"""Contrasts between guided and random triggers."""

import math
import random

import numpy as np
import pandas as pd
import pytest

from mutator.statistics import guided_against_random
from mutator.statistics.guided_against_random import FaultTypeStratum
from mutator.statistics.guided_against_random_tables import matched_pairs_sheet
from mutator.statistics.paired_statistics import PairCounts

from .results_frame import results

RAN = {"t_activation": 7.0}
HIT = RAN | {"h3": 1, "t_h3": 9.0}


def pair(fault: str, guided: dict[str, object], random: dict[str, object]) -> list[dict[str, object]]:
    same = {"fault_id": fault, "trigger": "C1"}
    return [same | guided, same | random | {"method": "random", "trigger": "random/C1"}]


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    """Five pairs: a hazard in both runs; in the guided run only; in the random run only (c, and d with an
    inactive guided fault); in neither."""
    made = [
        *pair("a", HIT, HIT),
        *pair("b", HIT, RAN),
        *pair("c", RAN, HIT),
        *pair("d", {}, HIT),
        *pair("e", RAN, RAN),
    ]
    return results(*made, {"fault_id": "f", "trigger": "C1"} | HIT)  # and one guided run without a partner


def stratum(guided: tuple[int, int], random: tuple[int, int]) -> FaultTypeStratum:
    return FaultTypeStratum(
        fault_type="k",
        guided_hazards=guided[0],
        guided_runs=guided[1],
        random_hazards=random[0],
        random_runs=random[1],
    )


def test_the_pooled_odds_ratio_follows_the_textbook() -> None:
    """The Mantel-Haenszel ratio is the sum of a*d/n over the sum of b*c/n: (10*15/40 + 4*18/40) / (10*5/40 +
    16*2/40)."""
    pooled = guided_against_random.pool_odds_ratios([stratum((10, 20), (5, 20)), stratum((4, 20), (2, 20))])
    assert pooled.odds_ratio == pytest.approx((150 + 72) / (50 + 32))
    assert pooled.low < 1 < pooled.odds_ratio < pooled.high
    assert 0.05 < pooled.p_of_odds_ratio_1 < 1


def test_strata_without_hazards_do_not_affect_the_odds_ratio() -> None:
    one = stratum((10, 20), (5, 20))
    pooled = guided_against_random.pool_odds_ratios([one, stratum((0, 9), (0, 9))])
    assert pooled.odds_ratio == pytest.approx(guided_against_random.pool_odds_ratios([one]).odds_ratio)
    assert math.isnan(guided_against_random.pool_odds_ratios([stratum((0, 9), (0, 9))]).odds_ratio)


def test_holm_adjusts_as_in_the_textbook() -> None:
    assert guided_against_random.holm_adjusted([0.01, 0.04, 0.03]) == pytest.approx((0.03, 0.06, 0.06))
    assert guided_against_random.holm_adjusted([]) == ()


@pytest.mark.slow
def test_holm_adjusts_as_statsmodels_does() -> None:
    from statsmodels.stats.multitest import multipletests  # slow to import

    draw = random.Random(1)
    for _ in range(20):  # one call of `multipletests` takes 50 ms
        p_values = [
            draw.choice((0.0, 1.0, 0.01, math.nan, draw.random(), draw.random() / 100))
            for _ in range(draw.randint(1, 20))
        ]
        np.testing.assert_array_equal(
            guided_against_random.holm_adjusted(p_values), multipletests(p_values, method="holm")[1]
        )


def test_pairs_have_the_same_fault_scenario_and_row(frame: pd.DataFrame) -> None:
    found = guided_against_random.matched_pairs(frame)
    assert list(found["fault_id"]) == ["a", "b", "c", "d", "e"]
    assert guided_against_random.mcnemar_of_pairs(found) == PairCounts(
        both=1, first_only=1, second_only=2, neither=1, p_value=1.0
    )


def test_mcnemar_is_exact() -> None:
    """If all eight discordant pairs have the same sign, p is twice a half to the eighth."""
    made = [row for i in range(8) for row in pair(str(i), HIT, RAN)]
    assert guided_against_random.mcnemar_of_pairs(
        guided_against_random.matched_pairs(results(*made))
    ).p_value == pytest.approx(2 * 0.5**8)


def test_pairs_are_counted_per_injected_and_per_activated_fault(frame: pd.DataFrame) -> None:
    lines = [line[:7] for line in matched_pairs_sheet(frame).lines]
    assert lines == [
        ("all", "total", 5, 1, 1, 2, 1),
        ("all", "radar/chaff", 5, 1, 1, 2, 1),
        ("guided one activated", "total", 4, 1, 1, 1, 1),
        ("guided one activated", "radar/chaff", 4, 1, 1, 1, 1),
    ]


def test_resampling_draws_whole_faults() -> None:
    """Copies of a run in other scenarios add no information."""
    once = [row for i in range(12) for row in pair(str(i), HIT if i < 8 else RAN, HIT if i < 4 else RAN)]
    often = [row | {"scenario": s} for s in ("S1", "S2", "S3", "S4") for row in once]
    single, copied = (
        guided_against_random.resampled_rate_difference(results(*rows), "injected") for rows in (once, often)
    )
    assert single.difference == pytest.approx(4 / 12)
    assert single == copied
    assert single.low < 4 / 12 < single.high


def test_faults_that_all_agree_have_no_interval() -> None:
    for guided in (RAN, HIT):
        rows = [row for i in range(3) for row in pair(str(i), guided, RAN)]
        found = guided_against_random.resampled_rate_difference(results(*rows), "injected")
        assert found.difference == float(guided is HIT)
        assert math.isnan(found.low) and math.isnan(found.high)


@pytest.mark.filterwarnings("error")
def test_an_interval_needs_both_methods_in_every_draw() -> None:
    """If each fault has runs of one method only, some resamples have no difference."""
    found = guided_against_random.resampled_rate_difference(
        results(HIT | {"fault_id": "a"}, RAN | {"fault_id": "b", "method": "random"}), "activated"
    )
    assert found.difference == 1.0
    assert math.isnan(found.low) and math.isnan(found.high)


def test_a_difference_needs_runs_of_both_methods() -> None:
    found = guided_against_random.resampled_rate_difference(results(HIT, RAN), "activated")
    assert math.isnan(found.difference)
    assert math.isnan(found.low)
