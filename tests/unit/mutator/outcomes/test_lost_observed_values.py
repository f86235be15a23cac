"""Observed values that become NaN or infinite."""

import numpy as np
import pytest

from mutator.outcomes.lost_observed_values import find_lost_value, find_value_lost_for_good
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

NAN, INF = np.nan, np.inf


@pytest.fixture
def manifest(toycar: Workspace) -> TargetManifest:
    path = toycar.manifest("toycar").path
    names = "  d_rel: {unit: m, role: truth, from: gap}\n  v_ego: {unit: m/s, role: truth, from: speed}\n"
    path.write_text(path.read_text().replace("observation:\n", f"{names}observation:\n", 1))
    return toycar.manifest("toycar")


def trace(d_rel: list[float], v_ego: list[float] | None = None, hwt: float = 1.0) -> Trace:
    steps = len(d_rel)
    return {
        "time": np.arange(steps) * 0.05,
        "d_rel": np.array(d_rel),
        "v_ego": np.array(v_ego or [20.0] * steps),
        "hwt": np.full(steps, hwt),
    }


@pytest.mark.parametrize(
    ("golden", "faulty", "text"),
    [
        ([9, 8, 7], [9, NAN, NAN], "truth: d_rel is NaN at 0.05 s"),
        ([9, 8, 7], [9, 8, INF], "truth: d_rel is infinite at 0.1 s"),
        ([9, 8, 7], [9, -INF, NAN], "truth: d_rel is infinite at 0.05 s"),
        ([INF, INF, 7], [INF, NAN, 7], "truth: d_rel is NaN at 0.05 s"),
        ([9, 8], [9, 8, NAN], "truth: d_rel is NaN at 0.1 s"),
        ([9, 8, 7], [9, NAN], "truth: d_rel is NaN at 0.05 s"),
        ([9, 8, 7], [9, 0, -7], None),
        ([NAN, NAN, 7], [NAN, NAN, 7], None),
        ([NAN, 8, 7], [INF, 8, 7], None),
        ([9, 8, INF], [9, 8, -INF], None),
        ([9, NAN], [9, NAN, NAN], None),
        ([9, 8, NAN, 9], [9, NAN, NAN, NAN], None),
        ([NAN, 8, 7], [NAN, NAN, 7], None),
        ([NAN, 8, 7], [NAN, 8, NAN], "truth: d_rel is NaN at 0.1 s"),
        ([NAN, 8, 7], [9, NAN, 7], "truth: d_rel is NaN at 0.05 s"),
        ([9, NAN, 7], [9, INF, NAN], None),
        ([9, NAN, 7], [9, NAN, INF], "truth: d_rel is infinite at 0.1 s"),
        ([9, 8, INF], [9, INF, INF], None),
        ([INF, 8, 7], [INF, INF, 7], None),
        ([INF, 8, 7], [INF, 8, INF], None),
        ([9, 8, INF], [9, -INF, INF], "truth: d_rel is infinite at 0.05 s"),
        ([INF, 8, 7], [INF, 8, NAN], "truth: d_rel is NaN at 0.1 s"),
    ],
)
def test_a_value_is_lost_where_the_golden_run_has_one(
    manifest: TargetManifest, golden: list[float], faulty: list[float], text: str | None
) -> None:
    """NaN counts unless golden has NaN in that step, or it can mean that there is nothing to observe (yet);
    infinity counts where golden is finite, unless golden is infinite in the same way in another step."""
    lost = find_lost_value(manifest, trace(golden), trace(faulty), None)
    assert (str(lost) if lost else None) == text


def test_the_first_lost_value_of_several_counts(manifest: TargetManifest) -> None:
    faulty = trace([9, 8, NAN], [20, INF, INF])
    lost = find_lost_value(manifest, trace([9, 8, 7]), faulty, None)
    assert str(lost) == "truth: v_ego is infinite at 0.05 s"


def test_nothing_is_lost_after_the_end_of_the_drive_or_in_a_derived_value(manifest: TargetManifest) -> None:
    """After a terminal hazard the drive is over. A headway is infinite at standstill."""
    golden = trace([9, 8, 7])
    assert find_lost_value(manifest, golden, trace([9, 0, NAN]), 0.05) is None
    assert find_lost_value(manifest, golden, trace([9, 8, 7], hwt=NAN), None) is None


@pytest.mark.parametrize(
    ("values", "time"),
    [
        ([9, NAN, NAN], 0.05),
        ([NAN, 8, NAN], 0.1),
        ([9, NAN, 7], None),
        ([NAN] * 3, None),
        ([9, INF, INF], None),
    ],
)
def test_a_value_is_lost_for_good_if_no_number_follows(
    manifest: TargetManifest, values: list[float], time: float | None
) -> None:
    """A lead that comes, goes and comes back leaves gaps of NaN, which are legitimate."""
    lost = find_value_lost_for_good(manifest, trace(values), None)
    assert (lost and lost.time_s) == time


def test_a_channel_that_is_not_recorded_is_not_judged(manifest: TargetManifest) -> None:
    golden = {name: values for name, values in trace([9, 8]).items() if name != "d_rel"}
    assert find_lost_value(manifest, golden, trace([9, NAN]), None) is None
