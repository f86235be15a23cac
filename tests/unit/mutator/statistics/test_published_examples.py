"""Worked examples from the literature: each test and interval of a report gives the published numbers."""

import math

import pandas as pd
import pytest
from statsmodels.stats.proportion import proportion_confint

from mutator.paper.measures import estimate_of_difference, mean_time, paired
from mutator.statistics import guided_against_random
from mutator.statistics.guided_against_random import FaultTypeStratum
from mutator.statistics.paired_statistics import mcnemar_test, paired_times
from mutator.statistics.shares_with_intervals import CONFIDENCE_LEVEL, share_with_interval

from . import by_hand
from .results_frame import results


def stratum(a: int, b: int, c: int, d: int) -> FaultTypeStratum:
    """Guided with and without hazard, random with and without hazard."""
    return FaultTypeStratum(
        fault_type="k", guided_hazards=a, guided_runs=a + b, random_hazards=c, random_runs=c + d
    )


@pytest.mark.parametrize("of", [1, 2, 7, 60, 369, 1128, 1_000_003])
def test_wilson_as_statsmodels(of: int) -> None:
    """All bytes are those of statsmodels, which the harness does not import for this."""
    for count in {0, 1, of // 11, of // 3, of // 2, of - 1, of}:
        low, high = proportion_confint(count, of, alpha=1 - CONFIDENCE_LEVEL, method="wilson")
        share = share_with_interval(count, of)
        assert (share.low, share.high) == (round(low, 12), round(high, 12))


@pytest.mark.parametrize(
    ("count", "of", "low", "high"),
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson(count: int, of: int, low: float, high: float) -> None:
    """The intervals are those in Newcombe, Statistics in Medicine 17 (1998) 857-872, table I, method 3."""
    found = share_with_interval(count, of)
    assert (round(found.low, 4), round(found.high, 4)) == (low, high)


# admitted and not: men, women, in each department (Bickel et al., Science 187 (1975); R's `UCBAdmissions`)
BERKELEY = [
    *((512, 313, 89, 19), (353, 207, 17, 8), (120, 205, 202, 391)),
    *((138, 279, 131, 244), (53, 138, 94, 299), (22, 351, 24, 317)),
]


def test_mantel_haenszel() -> None:
    """The result of R's `mantelhaen.test`."""
    found = guided_against_random.pool_odds_ratios([stratum(*table) for table in BERKELEY])
    assert found.odds_ratio == pytest.approx(0.9046968, abs=1e-7)
    assert (found.low, found.high) == pytest.approx((0.7719074, 1.0603298), abs=1e-7)
    assert found.stratum_count == 6


@pytest.mark.parametrize(
    ("tables", "p"),
    [
        ([(25, 30, 17, 12), (6, 4, 94, 68)], 0.4483),
        ([(21, 12, 118, 25), (148, 96, 150, 92)], 0.04026),
    ],
    ids=["teeth", "cervical cancer"],
)
def test_breslow_day(tables: list[tuple[int, int, int, int]], p: float) -> None:
    """The results equal those of DescTools' BreslowDayTest in the course P8120 of Columbia University."""
    found = guided_against_random.pool_odds_ratios([stratum(*table) for table in tables])
    assert found.p_of_equal_odds_ratios == pytest.approx(p, rel=2e-4)


@pytest.mark.parametrize(
    ("table", "p"),
    [((3, 1, 1, 3), 0.4857), ((2, 15, 10, 3), 0.0005367), (BERKELEY[1], 0.6771)],
    ids=["tea", "twins", "department B"],
)
def test_fisher(table: tuple[int, int, int, int], p: float) -> None:
    """Fisher's test gives the p-values of R's `fisher.test` for the lady tasting tea and the convictions
    of twins, and that of SAS for Berkeley's department B (Pennsylvania State University, STAT 504)."""
    assert guided_against_random.fisher_p(stratum(*table)) == pytest.approx(p, rel=2e-4)


def test_mcnemar() -> None:
    """The numbers are those of Liddell, Journal of Epidemiology and Community Health 37 (1983)."""
    first = pd.Series([True] * 21 + [False] * 9)
    assert mcnemar_test(first, ~first).p_value == pytest.approx(0.0428, abs=5e-5)


def test_wilcoxon() -> None:
    """Hamilton's depression scale before and after a tranquilizer (Hollander and Wolfe, Nonparametric
    Statistical Methods (1973), table 3.1). The median's interval goes from the second to the eighth of nine
    differences."""
    before = pd.Series([1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30])
    after = pd.Series([0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29])
    found = paired_times(before, after)
    assert found.p_value == pytest.approx(0.0390625)
    differences = sorted((after - before).round(9))
    assert (found.median_difference.low, found.median_difference.high) == (differences[1], differences[7])


def test_newcombe() -> None:
    """The example is in Newcombe, Statistics in Medicine 17 (1998) 873-890, table II, method 10."""
    found = estimate_of_difference(share_with_interval(56, 70), share_with_interval(48, 80))
    assert found.value == pytest.approx(0.2)
    assert (round(found.low, 4), round(found.high, 4)) == (0.0524, 0.3339)


def test_clopper_pearson() -> None:
    """The example is in Newcombe 1998, table I, method 5."""
    rows = []
    for i in range(263):
        same = {"fault_id": str(i), "t_activation": 1.0}
        hit, miss = same | {"h1": 1, "t_h1": 2.0}, same
        guided, random = (hit, miss) if i < 81 else (miss, hit)
        rows += [guided | {"trigger": "C1"}, random | {"method": "random", "trigger": "random/C1"}]
    found = paired(results(*rows), of="")
    assert (found.n, round(found.low, 4), round(found.high, 4)) == (263, 0.2527, 0.3676)


def test_student() -> None:
    """Differences in hours of sleep (Student, Biometrika 6 (1908); R's `sleep`)."""
    more = [1.2, 2.4, 1.3, 1.3, 0.0, 1.0, 1.8, 0.8, 4.6, 1.4]
    frame = results(*({"t_activation": 1.0, "t_manifest": 1.0 + hours} for hours in more))
    found = mean_time(frame, of="", start="t_activation", end="t_manifest")
    assert found.value == pytest.approx(1.58)
    assert (found.low, found.high) == pytest.approx((0.7001142, 2.4598858), abs=1e-6)


def test_the_second_implementation_gives_the_published_numbers() -> None:
    """The ten tables are checked with the second implementation."""
    odds = by_hand.pooled_odds(BERKELEY)
    assert (odds["odds ratio"], odds["low"]) == pytest.approx((0.9046968, 0.7719074), abs=1e-7)
    assert by_hand.fisher((3, 1, 1, 3)) == pytest.approx(0.4857, abs=5e-5)
    assert by_hand.sign_test(21, 9) == pytest.approx(0.0428, abs=5e-5)
    assert by_hand.wilson(15, 148) == pytest.approx((0.0624, 0.1605), abs=5e-5)
    assert by_hand.chi_squared_tail(11.0705, 5) == pytest.approx(0.05, abs=1e-6)
    assert by_hand.holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    curve = by_hand.kaplan_meier([(6, True), (6, False), (7, True), (9, False)])
    assert [step[:2] for step in curve] == [(6, 0.75), (7, 0.375)]
    assert math.isnan(by_hand.median_time([(1, True), (2, False), (3, False)])[0])
