"""Which channels leave golden, and the table that lists them."""

import numpy as np
import pytest

from mutator._common.typed_json import typed_value_from_json
from mutator.model import ObservedActivation, Outcome, Record, Status
from mutator.outcomes.channel_departures import departures_from_golden
from mutator.outcomes.golden_trace_comparison import compare_traces
from mutator.results.propagation_columns import PROPAGATION_COLUMNS, propagation_cells
from mutator.targets.channels import Channel
from mutator.targets.stored_target_facts import ChannelFacts

T = np.arange(6) * 0.1
ZEROS = np.zeros(6)


def channel(name: str, tolerance: float = 0.0) -> Channel:
    return Channel(name=name, unit="-", tolerance=tolerance)


def stepped(row: int, height: float = 1.0) -> np.ndarray:
    return np.where(np.arange(6) >= row, height, 0.0)


def left(golden: dict, faulty: dict, *channels: Channel, t_end: float | None = None) -> tuple:
    return departures_from_golden({"t": T, **golden}, {"t": T, **faulty}, channels, "t", t_end)


def test_a_channel_leaves_golden_when_it_exceeds_its_tolerance() -> None:
    faulty = {"a": stepped(2, 0.5), "b": stepped(1, 0.3) + stepped(4), "c": ZEROS}
    found = left({"a": ZEROS, "b": ZEROS, "c": ZEROS}, faulty, *(channel(n, 0.5) for n in "abc"))
    assert found == (("b", T[4], 1.3),)


def test_differences_after_the_end_of_the_drive_are_ignored() -> None:
    golden, faulty = {"a": ZEROS, "b": ZEROS}, {"a": stepped(2) + stepped(4, 9.0), "b": stepped(4)}
    assert left(golden, faulty, channel("a"), channel("b"), t_end=T[3]) == (("a", T[2], 1.0),)
    assert left(golden, faulty, channel("b"), t_end=T[4]) == (("b", T[4], 1.0),)


def test_non_finite_values_are_compared() -> None:
    golden = {"a": np.array([np.nan, np.inf, 0, 0, 0, 0])}
    assert left(golden, {"a": golden["a"].copy()}, channel("a", 1.0)) == ()
    faulty = {"a": np.array([np.nan, np.inf, np.nan, 0, 0, 0])}
    assert left(golden, faulty, channel("a", 1.0)) == (("a", T[2], np.inf),)


def test_channels_are_compared_at_their_own_times() -> None:
    """If a message is late, its channel leaves golden when the message is first missing."""
    golden = {"a": np.array([1.0, 2.0]), "a@": np.array([0.0, 0.3])}
    assert left(golden, dict(golden), channel("a")) == ()
    assert left(golden, golden | {"a": np.array([1.0, 5.0])}, channel("a")) == (("a", 0.3, 3.0),)
    late = golden | {"a@": np.array([0.0, 0.5])}
    assert left(golden, late, channel("a")) == (("a", 0.3, 1.0),)


def test_a_channel_that_was_not_recorded_is_left_out() -> None:
    assert left({"a": ZEROS}, {"b": ZEROS}, channel("a"), channel("b")) == ()


def test_all_channels_leave_golden_where_the_shorter_run_ends() -> None:
    golden, faulty = {"t": T, "a": ZEROS}, {"t": T[:4], "a": ZEROS[:4]}
    assert departures_from_golden(golden, faulty, [channel("a")], "t", None) == (("a", T[4], 0.0),)
    assert departures_from_golden(golden, faulty, [channel("a")], "t", float(T[3])) == ()
    rare = {"a": np.array([1.0]), "a@": np.array([0.1])}
    assert departures_from_golden(golden | rare, faulty | rare, [channel("a")], "t", None) == (
        ("a", T[4], 0.0),
    )


@pytest.mark.parametrize("seed", range(20))
def test_departures_agree_with_the_comparison(seed: int) -> None:
    random = np.random.default_rng(seed)
    channels = [channel(name, float(random.integers(0, 3))) for name in "abc"]
    golden = {"t": T, **{name: random.integers(-2, 3, 6).astype(float) for name in "abc"}}
    faulty = {
        name: np.where(random.random(6) < 0.7, golden[name], random.integers(-2, 3, 6)) for name in "abc"
    }
    faulty["t"] = T
    found, compared = (
        departures_from_golden(golden, faulty, channels, "t", None),
        compare_traces(golden, faulty, channels, "t"),
    )
    assert min((first for _, first, _ in found), default=None) == compared.t_first
    assert {name: largest for name, _, largest in found}.items() <= dict(compared.max_dev).items()


def test_the_table_keeps_the_order_of_records_and_departures() -> None:
    record = Record(
        experiment_id="e1",
        status=Status.OK,
        outcome=Outcome.SDC,
        detail="",
        tree="",
        activation=ObservedActivation(first=0.1, last=0.2, count=1),
        t_manifest=0.3,
        max_dev=(),
        hazards=(),
        alerts=(),
        trace_digest="",
        left=(("seen", 0.1 + 0.2, 2.5), ("gas", 0.4, 1.0)),
    )
    facts = [["gas", "-", "actuator", "pedals", ""], ["seen", "m", "internal", "eyes", ""]]
    found = propagation_cells([record], typed_value_from_json(tuple[ChannelFacts, ...], facts))
    assert list(found) == [column.name for column in PROPAGATION_COLUMNS]
    assert list(zip(*found.values(), strict=True)) == [
        ("e1", "seen", "eyes", "internal", 0.3, 2.5),
        ("e1", "gas", "pedals", "actuator", 0.4, 1.0),
    ]
