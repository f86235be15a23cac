"""A campaign in scenarios of a family gives the same bytes on a cluster and after kills."""

import json
import os
import shutil
import signal
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

import mutator
from mutator.workspace import Workspace

from .command import Command, results
from .test_kills import CLONE, EVERY, Campaign

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


SHIPPED = """\
schema: campaign/1
name: killed
about: A test.
target: openpilot
scenarios: [{{family: acc_settings, sample: {count}, sampling: sobol}}]
faults: [{{spec: radar/chaff/distance, values: 1}}]
triggers: [{{at_s: 5}}, {{at_s: 10}}, {{at_s: 20}}]
seed: 0
canary: {{spec: radar/chaff/distance, scenario: S1, hazard: H1, at_s: 8.0}}
"""
FAULTS_PER_SCENARIO = 3
SCENARIOS = 6


def test_the_shipped_controller_in_a_family_survives_kills(tmp_path: Path) -> None:
    run_killed_families(tmp_path, SCENARIOS)


def run_killed_families(folder: Path, scenario_count: int) -> None:
    """Run undisturbed, then here and on a cluster, each killed twice and resumed, with a kill of a worker
    between. Nothing that was recorded is lost or run again, and all bytes are the same.
    """
    for name in ("fault_library", "templates", "target"):
        shutil.copytree(CLONE / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    workspace = Workspace.find(root=folder)
    (workspace.library / "campaigns" / "killed.yaml").write_text(SHIPPED.format(count=scenario_count))
    planned = FAULTS_PER_SCENARIO * scenario_count
    whole = folder / "whole"
    started(workspace, whole, "-n", "2").end()
    for name, words in (("here", ("-n", "2")), ("there", ("--cluster", "local:2"))):
        out = folder / name
        finished = 0
        for share in (0.2, 0.5):
            command = started(workspace, out, *words)
            command.wait_for_records(max(finished + 1, int(share * planned)))
            os.kill(next(iter(workers_of(command))), signal.SIGKILL)
            command.wait_for_records(recorded(out).total() + 1)
            command.process.kill()
            command.end()
            assert finished < recorded(out).total() < planned
            finished = recorded(out).total()
        before = recorded(out)
        started(workspace, out, *words).end()
        assert recorded(out) >= before
        assert recorded(out).total() == planned == len(recorded(out))  # none is lost, and none ran twice
        assert results(out) == results(whole)
        seals = {mutator.load_run(run, workspace=workspace).seals for run in (whole, out)}
        assert len(seals) == 1


def started(workspace: Workspace, out: Path, *words: str) -> Command:
    fixed = ("--out", str(out), "--no-stills", "--no-reuse")
    return Command(
        workspace, out, "-m", "mutator", "run", "killed", *fixed, *words, XDG_CACHE_HOME=f"{out}-cache"
    )


def workers_of(command: Command) -> Sequence[int]:
    """Return the processes that run experiments, here or on the machines of a cluster."""
    return command.workers() or [pid for pid, line in command.others() if "cluster.piece_process" in line]


def recorded(out: Path) -> Counter[str]:
    """Return how many records of experiments that ended normally the run folder has, by experiment."""
    lines = (line for path in (out / "records").glob("*.jsonl") for line in path.read_text().splitlines(True))
    whole = (json.loads(line) for line in lines if line.endswith("\n"))
    return Counter(record["experiment_id"] for record in whole if record.get("status") == "ok")
