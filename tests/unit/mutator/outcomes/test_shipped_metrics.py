"""The margins and metrics of the shipped target, compared with values computed by hand."""

from pathlib import Path

import numpy as np
import pytest

from mutator.outcomes.hazard_and_metric_judgement import RunJudgement, judge_run
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

BESIDE = 2.76  # m; at up to 2.75 m to the side, the cars overlap


@pytest.fixture(scope="module")
def manifest() -> TargetManifest:
    return Workspace.find(root=Path(__file__).parents[4]).manifest("openpilot")


def driven(manifest: TargetManifest, gaps: list[float], offsets: list[float]) -> RunJudgement:
    """Judge a drive at 10 m/s behind a vehicle at 8 m/s, in steps of one second."""
    trace = {channel.name: np.zeros(len(gaps)) for channel in manifest.criteria_channels}
    trace |= {"t": np.arange(len(gaps), dtype=float), "d_rel": np.array(gaps), "hwt": np.array(gaps) / 10}
    trace |= {"v_ego": np.full(len(gaps), 10.0), "v_lead": np.full(len(gaps), 8.0)}
    return judge_run(manifest, trace | {"lateral_offset": np.array(offsets)}, {"hazards": {}})


OF_THE_GAP = ("margin_h1", "smallest_gap", "smallest_hwt", "smallest_ttc", "largest_drac", "contact_speed")


@pytest.mark.parametrize(
    ("gaps", "offsets", "values"),
    [
        # the car leaves its lane behind a vehicle, passes it, and returns behind the next one
        ([10, 6, 2, -3, -40, 30], [0, 2.75, BESIDE, 3, -BESIDE, -2.75], [6, 6, 0.6, 3, 4 / 12, None]),
        # contact at 2 s, overlap until 3 s; time to collision and needed deceleration end 1 s before it
        ([10, 4, -1, -3], [0, 1, 2, 2], [-1, -1, -0.1, 5, 4 / 20, 2]),
        ([3, 1, -1], [BESIDE, 3, 9], [None] * 6),  # the car is never behind the vehicle
    ],
)
def test_a_vehicle_beside_the_car_is_ignored(
    manifest: TargetManifest, gaps: list[float], offsets: list[float], values: list[float | None]
) -> None:
    """Such a vehicle is near but harmless."""
    found = dict(driven(manifest, gaps, offsets).metrics)
    expected = {name: value for name, value in zip(OF_THE_GAP, values, strict=True) if value is not None}
    assert {name: found[name] for name in OF_THE_GAP if name in found} == pytest.approx(expected)


def test_the_margin_of_h1_is_positive_unless_the_hazard_occurred(manifest: TargetManifest) -> None:
    for offset in (0.0, 2.75, BESIDE, -9.0):
        judged = driven(manifest, [5, 0, -1], [offset] * 3)
        margin = dict(judged.metrics).get("margin_h1", np.inf)
        assert ("H1" in dict(judged.hazards)) == (margin <= 0), offset
