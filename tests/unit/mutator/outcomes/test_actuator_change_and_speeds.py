"""The first actuator that left golden, its direction, and the speeds after an activation."""

from dataclasses import replace

import numpy as np
import pytest

from mutator.model import ObservedActivation
from mutator.outcomes.actuator_change_and_speeds import (
    first_actuator_change,
    share_in_direction,
    speeds_after_activation,
)
from mutator.outcomes.trace_and_record_loading import Trace
from mutator.targets.channels import Channel, Role
from mutator.workspace import Workspace

TIMES = np.arange(6) / 10
GAS, BRAKE = (Channel(name=name, unit="-", role=Role.ACTUATOR) for name in ("gas", "brake"))
GOLDEN = {"t": TIMES, "gas": np.full(6, 0.2), "brake": np.full(6, 0.1)}


def changed(**values: list[float]) -> Trace:
    return GOLDEN | {name: np.array(numbers) for name, numbers in values.items()}


@pytest.mark.parametrize(
    ("faulty", "t_manifest", "expected"),
    [
        ({"gas": [0.2, 0.2, 0.3, 0.0, 0.0, 0.0]}, 0.2, ("gas", "higher")),
        ({"gas": [0.2, 0.2, 0.3, 0.2, 0.2, 0.2], "brake": [0.1, 0.0, *[0.1] * 4]}, 0.1, ("brake", "lower")),
        ({"gas": [0.2, 0.1, 0.2, 0.2, 0.2, 0.2], "brake": [0.1, 0.3, *[0.1] * 4]}, 0.1, ("gas", "lower")),
        ({"gas": [0.2, np.nan, 0.2, 0.2, 0.2, 0.2]}, 0.1, ("gas", "no_number")),
        ({"gas": [0.2, -np.inf, 0.2, 0.2, 0.2, 0.2]}, 0.1, ("gas", "lower")),
        ({}, None, None),
    ],
)  # fmt: skip
def test_the_first_actuator_and_its_direction_follow_from_the_traces(
    faulty: dict[str, list[float]], t_manifest: float | None, expected: tuple[str, str] | None
) -> None:
    """The direction is that of the first difference, not of a later or larger one."""
    change = first_actuator_change(GOLDEN, changed(**faulty), (GAS, BRAKE), "t", t_manifest)
    assert change == expected


def test_a_run_that_only_ended_early_has_no_direction() -> None:
    """Where one run has no value, nobody knows whether it was higher or lower."""
    short = {name: values[:3] for name, values in GOLDEN.items()}
    assert first_actuator_change(GOLDEN, short, (GAS, BRAKE), "t", 0.3) is None
    golden = changed(gas=[np.nan, np.nan, 0.2, 0.2, 0.2, 0.2])
    assert first_actuator_change(golden, GOLDEN, (GAS,), "t", 0.0) is None


@pytest.mark.parametrize(
    ("gas", "end", "share"),
    [
        ([0.2, 0.2, 0.4, 0.4, 0.4, 0.4], None, 1.0),
        ([0.2, 0.4, 0.4, 0.2, 0.1, 0.0], None, 0.8),  # the last value has no time after it
        ([0.2, 0.4, 0.4, 0.1, 0.1, 0.1], 0.3, 1.0),
        ([0.2, 0.4, np.nan, 0.0, 0.2, 0.2], None, 0.5),
        ([0.2, 0.2, 0.2, 0.2, 0.2, 0.4], None, None),
    ],
)
def test_the_share_of_a_direction_is_that_of_the_areas(
    gas: list[float], end: float | None, share: float | None
) -> None:
    """It says whether the first change is what the fault did in the whole."""
    assert share_in_direction(GOLDEN, changed(gas=gas), "t", ("gas", "higher"), end) == pytest.approx(share)
    lower = share_in_direction(GOLDEN, changed(gas=gas), "t", ("gas", "lower"), end)
    assert lower == (None if share is None else pytest.approx(1.0 - share))
    assert share_in_direction(GOLDEN, changed(gas=gas), "t", None, end) is None


def test_a_value_counts_as_long_as_it_holds() -> None:
    """Steps can have different lengths."""
    times = {"t": np.array([0.0, 0.1, 0.4, 0.5])}
    golden, faulty = (times | {"gas": np.array(gas)} for gas in ([0.0] * 4, [0.0, 1.0, -1.0, 0.0]))
    assert share_in_direction(golden, faulty, "t", ("gas", "higher"), None) == pytest.approx(0.75)


def test_speeds_cover_the_time_from_activation_to_the_end(clone: Workspace) -> None:
    """Earlier and later speeds of either run do not count."""
    manifest = replace(clone.manifest("openpilot"), speed="v_ego")
    channels = {channel.name: np.zeros(6) for channel in manifest.criteria_channels}
    golden = {"t": TIMES} | channels | {"v_ego": np.array([9.0, 20.0, 21.0, 19.0, 20.0, 50.0])}
    faulty = {"t": TIMES} | channels | {"v_ego": np.array([9.0, 20.0, 25.0, 24.0, 3.0, 60.0])}
    activation = ObservedActivation(first=0.1, last=0.3, count=3)
    assert dict(speeds_after_activation(manifest, golden, faulty, activation, 0.3)) == {
        "speed_at_activation": 20.0,
        "highest_speed": 25.0,
        "lowest_speed": 20.0,
        "golden_highest_speed": 21.0,
        "golden_lowest_speed": 19.0,
    }
    assert dict(speeds_after_activation(manifest, golden, faulty, activation, None))["highest_speed"] == 60.0
    assert speeds_after_activation(manifest, golden, faulty, None, None) == ()
    assert speeds_after_activation(replace(manifest, speed=""), golden, faulty, activation, None) == ()
