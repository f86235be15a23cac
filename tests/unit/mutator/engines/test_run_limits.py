"""Limits that follow from golden runs."""

import pytest

from mutator.engines.run_limits import LIMITS_THAT_ARE_MEASURED, limits_before_measuring, measure_limits
from mutator.limits import Limits, MeasuredLimits

OWN = Limits(steps=6000)


@pytest.mark.parametrize(
    ("golden_cpu_s", "limit_s"),
    [
        ([], 10),
        ([0.2], 10),
        ([1.0], 10),
        ([1.01], 20),
        ([2.0, 0.1], 20),
        ([2.5], 30),
        ([3.1], 60),
        ([12.0], 120),
        ([12.1], 300),
        ([30.0], 300),
        ([30.1], 600),
        ([61.0], 900),
    ],
)
def test_a_limit_is_ten_times_the_longest_golden_run_rounded_up(
    golden_cpu_s: list[float], limit_s: int
) -> None:
    """Up to 10, 20, 30, 60, 120 or 300 s, and above that to a multiple of 300 s."""
    limits = measure_limits(OWN, LIMITS_THAT_ARE_MEASURED, golden_cpu_s)
    assert limits == MeasuredLimits(steps=6000, cpu_s=limit_s, wall_s=max(300, 5 * limit_s))


def test_limits_that_the_campaign_names_stay() -> None:
    assert measure_limits(OWN, {"wall_s"}, [61.0]) is OWN
    assert measure_limits(Limits(wall_s=60), {"cpu_s"}, [61.0]) == MeasuredLimits(cpu_s=900, wall_s=60)


def test_a_golden_run_has_time_until_its_limit_is_known() -> None:
    assert limits_before_measuring(OWN) == Limits(steps=6000, cpu_s=300)
    assert limits_before_measuring(OWN, {"wall_s"}) is OWN


def test_a_measured_limit_is_in_no_record() -> None:
    """Another machine measures another one, and its records must be the same."""
    fast, slow = (measure_limits(OWN, LIMITS_THAT_ARE_MEASURED, [cpu_s]) for cpu_s in (1.0, 100.0))
    assert fast.cpu_limit_text == slow.cpu_limit_text == "CPU time limit, ten times the golden run's"
    assert fast.wall_limit_text == slow.wall_limit_text
    assert OWN.cpu_limit_text == "CPU time limit of 60 s"
