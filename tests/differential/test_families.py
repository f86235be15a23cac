"""A campaign in scenarios of a family gives the same bytes on a cluster and after kills."""

from collections.abc import Callable
from pathlib import Path

import pytest

import mutator
from mutator.workspace import Workspace

from .test_kills import EVERY, Campaign

pytestmark = pytest.mark.slow

FAMILY = """\
schema: family/1
name: follow
title: The lead ahead keeps its speed
source: A test
parameters:
  ego_mps: {from: 10, to: 20, step: 0.5}
  gap_m: {from: 30, to: 60, step: 1}
sampling: sobol
template: |
  steps: 120
  speed: {{ ego_mps }}
  gap: {{ gap_m }}
  lead_speed: 18
  lead_brakes: 0
"""


def with_family(workspace: Workspace, count: int) -> Workspace:
    (workspace.library / "families").mkdir()
    (workspace.library / "families" / "follow.yaml").write_text(FAMILY)
    campaign = workspace.library / "campaigns" / "small.yaml"
    lines = [
        f"scenarios: [A, {{family: follow, sample: {count}}}]" if line.startswith("scenarios:") else line
        for line in campaign.read_text().splitlines()
        if not line.startswith("sample:")
    ]
    campaign.write_text("\n".join(lines) + "\n")
    return workspace


def test_kills_at_random_moments_lose_nothing(
    tmp_path: Path, copy_toycar: Callable[[Path], Workspace]
) -> None:
    workspace = with_family(copy_toycar(tmp_path), 30)
    words = ["-m", "mutator", "run", "small", "-n", "2"]
    campaign = Campaign(workspace, tmp_path, words, seed=51)
    campaign.kill_and_resume(EVERY * 2)
    assert len(set(campaign.stages)) > 1


def test_a_cluster_gives_the_same_bytes(tmp_path: Path, copy_toycar: Callable[[Path], Workspace]) -> None:
    workspace = with_family(copy_toycar(tmp_path), 12)
    here, there = tmp_path / "here", tmp_path / "there"
    mutator.run("small", here, workspace=workspace, workers=2, reuse=False)
    mutator.run("small", there, workspace=workspace, reuse=False, cluster="local:2")
    assert (there / "results.csv").read_bytes() == (here / "results.csv").read_bytes()
    seals = {mutator.load_run(out, workspace=workspace).seals.seal for out in (here, there)}
    assert len(seals) == 1
    assert None not in seals
