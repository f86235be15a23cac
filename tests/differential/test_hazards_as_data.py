"""The hazards in the shipped target's manifest occur at the times that its own checker finds."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from selfdrive.sim.hazards import HazardMonitor
from selfdrive.sim.truth import GroundTruth

from mutator.outcomes.hazard_and_metric_judgement import judge_run
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

# the checker's thresholds and their neighbours
NEAR = [0.0, 0.3, 0.5 * (3.7 - 1.8), 0.5 * (3.7 + 1.8), 100.0, 200.0]
NUMBERS = st.one_of(
    *(st.sampled_from([at, np.nextafter(at, -np.inf), np.nextafter(at, np.inf), -at]) for at in NEAR)
)
BRAKING = st.sampled_from([-9.0, np.nextafter(-3.5, -np.inf), -3.5, 0.0])
LEAD_SPEEDS = st.sampled_from([0.0, 0.3, 25.0, 200.0])
STEPS = st.lists(
    st.tuples(
        NUMBERS, NUMBERS, NUMBERS, st.sampled_from([0.0, 0.3, 25.0, 200.0]), BRAKING, st.integers(1, 60)
    ),
    min_size=1,
    max_size=40,
)


@pytest.fixture(scope="module")
def manifest() -> TargetManifest:
    return Workspace.find(root=Path(__file__).parents[2]).manifest("openpilot")


@settings(max_examples=1000, deadline=None)
@given(steps=STEPS)
@pytest.mark.slow
def test_manifest_and_checker_find_the_same_hazards(
    manifest: TargetManifest, steps: list[tuple[float, float, float, float, float, int]]
) -> None:
    monitor = HazardMonitor()
    rows = [row for *row, repeats in steps for _ in range(repeats)]
    t = np.arange(len(rows)) / 100
    for at, (d_rel, v_ego, offset, v_lead, a_ego) in zip(t, rows, strict=True):
        monitor.update(
            GroundTruth(
                t=float(at),
                d_rel=d_rel,
                v_ego=v_ego,
                v_lead=v_lead,
                a_ego=a_ego,
                lateral_offset=offset,
                heading=0.0,
                steer_angle=0.0,
                steer_rate=0.0,
                position=0.0,
                hwt=0.0,
                free_road=d_rel == 200.0,
            )
        )
    columns = np.array(rows).T
    names = [channel.name for channel in manifest.criteria_channels]
    trace = dict.fromkeys(names, np.zeros(len(rows))) | {"t": t}
    trace |= dict(zip(("d_rel", "v_ego", "lateral_offset", "v_lead", "a_ego"), columns, strict=True))
    found = dict(judge_run(manifest, trace, {"hazards": {}}).hazards)
    assert found == {name: time for name, time in monitor.first.items() if time is not None}
