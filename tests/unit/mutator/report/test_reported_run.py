"""Whether the counts of a run are rates."""

from types import SimpleNamespace
from typing import Any

import pytest

from mutator.report.reported_run import ReportedRun
from mutator.statistics.sample_weights import SampledPlan
from mutator.store.plan_strata import PlanStrata, SampleDraw


def drawn(draw: SampleDraw) -> SampledPlan:
    return SampledPlan(strata=PlanStrata(draw=draw, size_by_stratum={"a": 3}), left_out_count=0)


@pytest.mark.parametrize(
    ("sample", "has_rates"),
    [
        (None, True),
        (drawn(SampleDraw.PROPORTIONAL), True),
        (drawn(SampleDraw.EVEN), False),
        (SampledPlan(strata=None, left_out_count=0), False),
        (SampledPlan(strata=None, left_out_count=0, is_explored=True), False),
    ],
)
def test_counts_of_a_plan_that_nothing_distorts_are_rates(
    sample: SampledPlan | None, has_rates: bool
) -> None:
    run: Any = SimpleNamespace(sampled_plan=sample)
    has_rates_of: Any = ReportedRun.has_rates
    assert has_rates_of.fget(run) is has_rates
