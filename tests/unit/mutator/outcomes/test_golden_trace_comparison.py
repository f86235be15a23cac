"""Comparing a run with its golden run."""

import numpy as np
import pytest

from mutator.outcomes.golden_trace_comparison import compare_traces
from mutator.outcomes.trace_and_record_loading import with_golden_times
from mutator.store.golden_runs import GoldenRun
from mutator.targets.channels import Channel, Role

T = np.arange(5) * 0.1
GAS = Channel(name="gas", unit="-")
BRAKE = Channel(name="brake", unit="-")


def trace(**channels: list[float]) -> dict[str, np.ndarray]:
    arrays = {name: np.array(values) for name, values in channels.items()}
    return {"t": T[: len(next(iter(arrays.values())))], **arrays}


def test_equal_traces_do_not_differ() -> None:
    same = trace(gas=[0.0, -0.0, np.nan, np.inf, -np.inf])
    difference = compare_traces(same, trace(gas=[-0.0, 0.0, np.nan, np.inf, -np.inf]), [GAS], "t")
    assert difference.t_first is None
    assert difference.max_dev == (("gas", 0.0),)


def test_steps_after_the_end_of_the_drive_affect_only_max_dev() -> None:
    golden, faulty = trace(gas=[0, 0, 0, 0, 0]), trace(gas=[0, 2, 1, 9, 0])
    found = compare_traces(golden, faulty, [GAS], "t", t_end=0.2)
    assert (found.max_dev, found.max_dev_in_drive) == ((("gas", 9.0),), (("gas", 2.0),))
    assert compare_traces(golden, faulty, [GAS], "t").max_dev_in_drive == found.max_dev


def test_a_channel_is_compared_at_its_own_times() -> None:
    own, times = np.array([0.0, 0.2]), T + 0.01
    golden = {"t": T, "gas": np.array([1.0, 2.0]), "gas@": own}
    faulty = {**golden, "t": times}
    assert compare_traces(golden, faulty, [GAS], "t").t_first is None
    assert compare_traces(golden, {**faulty, "t": times[:3]}, [GAS], "t").t_first == T[3]
    later = {**golden, "gas@": own + 0.05}
    assert compare_traces(golden, later, [GAS], "t").t_first == 0.0


@pytest.mark.parametrize(
    ("later", "first", "largest"),
    [
        ([0.0, 1.9, 2.5], 1.0, 7.0),  # the value 9 comes at 1.9 s instead of 1 s
        ([0.0, 1.0, 2.5], 2.0, 4.0),
        ([0.0, 1.0, 2.0], None, 0.0),
    ],
)
def test_a_value_at_another_time_is_a_difference(
    later: list[float], first: float | None, largest: float
) -> None:
    pedal = Channel(name="pedal", unit="-", role=Role.ACTUATOR, times_channel="t_pedal")
    values = np.array([2.0, 9.0, 5.0])
    golden = {"t": np.arange(6.0), "pedal": values, "pedal@": np.array([0.0, 1.0, 2.0])}
    found = compare_traces(golden, golden | {"pedal@": np.array(later)}, [pedal], "t")
    assert found.t_first == first
    assert dict(found.max_dev) == {"pedal": largest}


@pytest.mark.parametrize("times", [T, T + 0.01, T[:3]], ids=["equal", "others", "shorter"])
def test_shared_times_do_not_change_a_comparison(times: np.ndarray) -> None:
    golden = trace(gas=[1, 2, 3, 4, 5])
    faulty = {"t": times.copy(), "gas": np.array([1, 2, 3.5, 4, np.nan])[: len(times)]}
    shared = with_golden_times(golden, faulty, "t")
    assert (shared["t"] is golden["t"]) == (times is T)
    assert compare_traces(golden, shared, [GAS], "t") == compare_traces(golden, faulty, [GAS], "t")


@pytest.mark.parametrize(
    ("gas", "brake", "back"),
    [
        ([0, 1, 0, 0, 0], [0, 0, 0, 0, 0], 1.0),
        ([0, 1, 0, 0, 0], [0, 0, 1, 0, 0], 2.0),  # the last channel to come back
        ([0, 1, 0, 1, 0], [0, 0, 0, 0, 0], None),  # as golden for the last step alone
        ([0, 1, 0, 0], [0, 0, 0, 0], None),  # the run is shorter
        ([0, 0, 0, 0, 0], [0, 0, 0, 0, 0], None),  # it never left golden
    ],
)
def test_a_run_is_back_if_it_ends_as_golden_for_two_seconds(
    gas: list[float], brake: list[float], back: float | None
) -> None:
    seconds = np.arange(5.0)
    golden = {"t": seconds, "gas": np.zeros(5), "brake": np.zeros(5)}
    faulty = {"t": seconds[: len(gas)], "gas": np.array(gas), "brake": np.array(brake)}
    assert compare_traces(golden, faulty, [GAS, BRAKE], "t").t_back == back


def test_the_first_and_the_largest_difference_are_found() -> None:
    golden = trace(gas=[0, 0, 0, 0, 0], brake=[1, 1, 1, 1, 1])
    faulty = trace(gas=[0, 0, 0, 0.5, -2], brake=[1, 1, 1.25, 1, 1])
    difference = compare_traces(golden, faulty, [GAS, BRAKE], "t")
    assert difference.t_first == T[2]
    assert difference.max_dev == (("gas", 2.0), ("brake", 0.25))


@pytest.mark.parametrize(("step", "first"), [(1e-12, T[3]), (0.5, T[3])])
def test_without_a_tolerance_any_difference_is_a_manifestation(step: float, first: float) -> None:
    difference = compare_traces(trace(gas=[1, 1, 1, 1, 1]), trace(gas=[1, 1, 1, 1 + step, 1]), [GAS], "t")
    assert difference.t_first == first


def test_a_difference_within_its_tolerance_is_not_a_manifestation() -> None:
    channel = Channel(name="gas", unit="-", tolerance=0.1)
    difference = compare_traces(trace(gas=[1, 1, 1]), trace(gas=[1, 1.05, 1]), [channel], "t")
    assert difference.t_first is None
    assert difference.max_dev[0][1] == pytest.approx(0.05)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_non_finite_value_is_an_infinite_difference(value: float) -> None:
    channel = Channel(name="gas", unit="-", tolerance=100.0)
    difference = compare_traces(trace(gas=[1, 1, 1]), trace(gas=[1, value, 1]), [channel], "t")
    assert difference.t_first == T[1]
    assert difference.max_dev == (("gas", np.inf),)


@pytest.mark.parametrize(("golden", "faulty"), [(3, 5), (5, 3)])
def test_runs_of_different_lengths_differ_where_one_ends(golden: int, faulty: int) -> None:
    difference = compare_traces(trace(gas=[0] * golden), trace(gas=[0] * faulty), [GAS], "t")
    assert difference.t_first == T[3]


def test_boolean_channels_are_compared() -> None:
    golden = {"t": T[:2], "gas": np.array([True, False])}
    faulty = {"t": T[:2], "gas": np.array([True, True])}
    assert compare_traces(golden, faulty, [GAS], "t").t_first == T[1]


def test_the_key_of_a_golden_run_names_its_scenario_and_changes() -> None:
    assert GoldenRun("S1").key == "S1"
    assert GoldenRun("S1", ("no_lead",)).key == "S1+no_lead"
