"""How critical the golden run is when a fault begins."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from mutator.explore.cell_results import MOST_TIME_MARGIN_MS
from mutator.explore.golden_drives import drive_of
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace
from tests.unit.mutator.explore.test_plane_exploration import PLANE

STEPS = 5


@pytest.fixture(scope="module")
def manifest() -> TargetManifest:
    return Workspace.find().manifest("openpilot")


def golden(**values: list[float]) -> Mapping[str, np.ndarray]:
    """A drive with a vehicle far ahead, but for these values."""
    still = {"d_rel": 100.0, "rs": -1.0, "v_ego": 20.0, "hwt": 5.0, "lateral_offset": 0.0}
    arrays = {name: np.full(STEPS, value) for name, value in still.items()}
    return {"t": np.arange(STEPS) * 0.01, **arrays, **{name: np.array(v) for name, v in values.items()}}


@pytest.mark.parametrize(
    ("values", "expected_ms"),
    [
        ({}, 5000),  # headway
        ({"rs": [50.0, 50.0, -1.0, 50.0, 50.0]}, 5000),  # time to collision at other steps does not count
        ({"rs": [-1.0, -1.0, 50.0, -1.0, -1.0]}, 2000),
        ({"rs": [50.0] * STEPS, "lateral_offset": [9.0] * STEPS}, MOST_TIME_MARGIN_MS),  # beside the vehicle
        ({"hwt": [np.inf] * STEPS}, MOST_TIME_MARGIN_MS),
        ({"hwt": [-1.0] * STEPS}, 0),
    ],
)
def test_the_shortest_time_at_the_start_counts(
    manifest: TargetManifest, values: dict[str, list[float]], expected_ms: int
) -> None:
    """Of headway and time to collision, where these metrics apply."""
    plane = replace(PLANE, condition="t >= 0.02")
    assert drive_of(manifest, golden(**values), plane).time_margin_ms == expected_ms


def test_without_such_metrics_no_start_is_more_critical(manifest: TargetManifest) -> None:
    """Values that the golden run does not record are none, either."""
    recorded = {name: values for name, values in golden().items() if name == "t"}
    assert drive_of(manifest, recorded, PLANE).time_margin_ms == MOST_TIME_MARGIN_MS
