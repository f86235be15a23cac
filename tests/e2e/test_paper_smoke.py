"""One per cent of the paper's campaign on the shipped controller."""

import csv
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.workspace import Workspace

pytestmark = pytest.mark.slow


def test_one_per_cent_of_the_papers_campaign_completes(tmp_path: Path) -> None:
    workspace, out = Workspace.find(root=Path(__file__).parents[2]), tmp_path / "run"
    summary = run_campaign(workspace, "paper_smoke", out, workers=2)
    assert (summary.exit_code, summary.done, summary.planned) == (0, 113, 113)
    assert (summary.harness_errors, summary.problem) == ((), "")
    rows = list(csv.DictReader((out / "results.csv").open()))
    assert len({row["experiment_id"] for row in rows}) == 113
    seen = {(row["scenario"], row["method"]) for row in rows}
    assert seen == {(f"S{i}", method) for i in range(1, 6) for method in ("guided", "random")}
    before = (out / "results.csv").read_bytes()
    again = run_campaign(workspace, "paper_smoke", out, workers=2)
    assert (again.exit_code, again.ran, again.done) == (0, 0, 113)
    assert (out / "results.csv").read_bytes() == before
