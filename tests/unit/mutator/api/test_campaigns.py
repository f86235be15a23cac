"""Plan, run and compare campaigns from Python."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator.api import campaigns
from mutator.errors import MutatorError
from mutator.execution import campaign_running
from mutator.workspace import Workspace

TWO = mutator.Choices(only='fault_type == "lane"', limit=2)


def test_a_plan_has_a_repr_and_a_frame(toycar: Workspace, tmp_path: Path) -> None:
    plan = mutator.plan("toy", workspace=toycar)
    assert repr(plan) == "<Plan of toy, as_described: 24 experiments, seed 7>"
    assert "sensor/lane" in plan._repr_html_()
    assert list(plan.frame().index) == [e.id for e in plan.experiments]
    assert sum(plan.groups().values()) == 24
    assert mutator.plan("toy", choices=mutator.Choices(seed=8), workspace=toycar).digest != plan.digest
    assert not (tmp_path / "p").exists()
    frozen = mutator.plan("toy", tmp_path / "p", workspace=toycar)
    assert frozen.digest == plan.digest == mutator.load_run(tmp_path / "p").plan.digest


def test_a_campaign_can_be_run_resumed_and_compared(toycar: Workspace, tmp_path: Path) -> None:
    seen: list[mutator.Progress] = []
    first = mutator.run("small", tmp_path / "a", choices=TWO, workspace=toycar, progress=seen.append)
    assert first.summary is not None
    assert (first.summary.ran, first.summary.done, len(first.results)) == (2, 2, 2)
    stages = {progress.stage for progress in seen} - {"proof"}  # so short a proof can end between two polls
    assert stages == {"plan", "checks", "golden", "experiments", "tables"}
    again = mutator.run("small", tmp_path / "a", workspace=toycar.library.parent)
    assert again.summary is not None
    assert (again.summary.ran, again.summary.done) == (0, 2)

    tree = toycar.library.parent / "tree" / "toycar" / "driver.py"
    tree.write_text(tree.read_text() + "\n# another version of the driver\n")
    mutator.run("small", tmp_path / "b", choices=TWO, workspace=toycar)
    same = mutator.compare(first, tmp_path / "b")
    assert (len(same.pairs), len(same.changed)) == (2, 0)
    assert list(same.tables["changes"]["fault type"]) == ["sensor/lane", "total"]
    hazards = same.tables["rates"].set_index("what").loc["hazard"]
    assert (hazards["pairs"], hazards["a: rate"], hazards["b: rate"]) == (2, 0.5, 0.5)
    assert same.findings(["new-hazard", mutator.Gate.UNMATCHED]) == ()
    assert "2 experiments" in repr(same)
    assert "<p>What changed</p>" in same._repr_html_()
    assert "&lt;p&gt;" not in same._repr_html_()
    assert same.write().pairs == tmp_path / "b" / "report" / "compare-a" / "pairs.csv"
    with pytest.raises(MutatorError, match="gate 'bad'"):
        same.findings(["bad"])


def test_a_metric_over_both_runs_needs_the_manifest_alone(toycar: Workspace, tmp_path: Path) -> None:
    with toycar.manifest("toycar").path.open("a") as file:
        file.write('metrics: {wheel_apart: {max: abs(wheel_turn - golden.wheel_turn), unit: "-", ')
        file.write("worse: higher, about: largest difference of the wheel}}\n")
    run = mutator.run("small", tmp_path / "a", choices=TWO, workspace=toycar)
    assert run.results["wheel_apart"].tolist() == run.results["max_dev_wheel"].tolist()
    assert run.results["wheel_apart"].max() > 0.0
    assert "wheel_apart" in (tmp_path / "a" / "results.csv").read_text().splitlines()[0].split(",")
    assert "wheel_apart" in run.report().page.read_text()


def test_a_warning_names_harness_errors(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_campaign(*args: Any, **kwargs: Any) -> mutator.Summary:
        return replace(
            campaign_running.run_campaign(*args, **kwargs), harness_errors=(("abcd", "no memory"),), done=1
        )

    monkeypatch.setattr(campaigns, "run_campaign", run_campaign)
    with pytest.warns(mutator.IncompleteRun, match="1 of 2.*abcd: no memory.*the same call resumes"):
        mutator.run("small", tmp_path / "a", choices=TWO, workspace=toycar)
