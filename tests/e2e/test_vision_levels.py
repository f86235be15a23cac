"""Disturbed frames in the closed loop: each effect at each level with either detector."""

import csv
from collections import Counter
from pathlib import Path

import pytest
from selfdrive.sim.detection_memory import FILE_NAME

from mutator.execution.campaign_running import run_campaign
from mutator.store.plan_choices import Choices
from mutator.store.records import load_records
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow

FEW = Choices(only='fault_type in ("rain", "occlusion") and value == 5')


@pytest.fixture(scope="module")
def workspace() -> Workspace:
    return Workspace.find(root=Path(__file__).parents[2])


def departures(workspace: Workspace, out: Path, detector: str) -> Counter[str]:
    summary = run_campaign(workspace, f"vision_levels_{detector}", out, workers=2)
    assert (summary.exit_code, summary.done) == (0, 69)
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert {(row["status"], row["activated"]) for row in rows} == {("ok", "1")}
    return Counter(row["fault_type"] for row in rows if row["h3"] == "1")


def test_lane_departures_of_each_effect_and_detector(workspace: Workspace, tmp_path: Path) -> None:
    """Only strong contrast makes the car leave its lane: the published detector abstains from the lines that
    other effects displace, and the other detector is robust."""
    paper = departures(workspace, tmp_path / "paper", "paper")
    robust = departures(workspace, tmp_path / "robust", "robust")
    assert paper.keys() | robust.keys() == {"contrast"}
    assert 0 < paper.total() <= 2 and robust.total() <= 2


def test_the_frame_cache_changes_no_byte(
    workspace: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = tmp_path / "cache"
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache))
    runs = [tmp_path / "cold", tmp_path / "warm"]
    for out in runs:
        assert not (out.name == "cold" and cache.exists())
        assert run_campaign(workspace, "vision_levels_paper", out, workers=2, choices=FEW).exit_code == 0
    assert (cache / "mutator" / "targets" / "openpilot" / FILE_NAME).exists()
    cold, warm = runs
    assert len(load_records(cold)) == 2
    assert load_records(cold) == load_records(warm)
    for name in ("trace.npz", "record.json"):
        place = Path("golden") / "S1+pictures+paper_detector" / name
        assert (cold / place).read_bytes() == (warm / place).read_bytes()
