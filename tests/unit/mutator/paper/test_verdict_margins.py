"""The smallest change of a number that gives its claim another verdict."""

import pytest

from mutator.paper.measures import Estimate, estimate_of_share
from mutator.paper.observation_judging import ClaimRule, ClaimVerdict
from mutator.paper.verdict_margins import smallest_change
from mutator.statistics.shares_with_intervals import share_with_interval


@pytest.mark.parametrize(
    ("count", "of", "rule"),
    [
        (70, 100, {"above": 0.5}),
        (55, 100, {"above": 0.5}),
        (3, 100, {"below": 0.1}),
        (0, 99, {"never": 0.05}),
    ],
)
def test_the_change_of_a_count_is_the_smallest(count: int, of: int, rule: dict[str, float]) -> None:
    claim_rule = ClaimRule(**rule)

    def verdict(k: int) -> ClaimVerdict:
        return claim_rule.verdict_on(estimate_of_share(share_with_interval(k, of)))

    margin = smallest_change(claim_rule, estimate_of_share(share_with_interval(count, of)), "share")
    assert margin is not None
    others = [k for k in range(of + 1) if verdict(k) is not verdict(count)]
    assert margin.size == min(abs(k - count) for k in others)
    assert margin.verdict is not verdict(count) and f"instead of {count}" in margin.text


def test_a_difference_moves_with_its_interval() -> None:
    """+5 points, 1 to 9, of 200 runs: 1 point less, 2 runs, and the interval contains 0."""
    estimate = Estimate(value=0.05, low=0.01, high=0.09, n=200, text="")
    margin = smallest_change(ClaimRule(above=0.0), estimate, "difference")
    assert margin is not None and margin.verdict is ClaimVerdict.UNDECIDED
    assert margin.text == "-1.0 points, -2 of 200"


def test_a_time_changes_in_seconds() -> None:
    estimate = Estimate(value=1.0, low=0.8, high=1.2, n=50, text="")
    margin = smallest_change(ClaimRule(above=1.8), estimate, "mean_time")
    assert margin is not None and (margin.verdict, margin.text) == (ClaimVerdict.UNDECIDED, "+0.60 s")


def test_too_few_runs_have_no_change() -> None:
    few = estimate_of_share(share_with_interval(5, 9))
    assert smallest_change(ClaimRule(above=0.5), few, "share") is None


def test_a_weighted_share_moves_with_its_interval() -> None:
    """40 of 50 drawn runs stand for 60 %: the count alone, at 80 %, would need another change."""
    weighted = Estimate(value=0.6, low=0.53, high=0.67, n=50, text="", count_with_property=40)
    margin = smallest_change(ClaimRule(above=0.5), weighted, "share")
    assert margin is not None and margin.text == "-3.0 points, -2 of 50"
    margin = smallest_change(ClaimRule(never=0.05), weighted, "share")
    assert margin is not None and margin.text == "0 instead of 40 of 50 (-40)"
