"""The published observations in the report of a run."""

import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.paper.observations_panel import _differences_from_papers_mixture, build_observations_panel
from mutator.paper.published_numbers import load_published_numbers
from mutator.report.reported_run import ReportedRun
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from ..statistics.results_frame import results

SEEN: Any = None  # unused by these tests
REFERENCES = Path(__file__).parents[4] / "fault_library" / "references"


@pytest.mark.parametrize("shard", [None, "1/2"])
def test_claims_about_all_faults_need_the_whole_plan(
    toycar: Workspace, tmp_path: Path, shard: str | None
) -> None:
    """A shard is only a part of the plan."""
    shutil.copytree(REFERENCES, toycar.library / "references")
    freeze_plan(build_plan(toycar, "small", Choices(shard=shard)), tmp_path / "run", toycar)
    folder = RunFolder.open(tmp_path / "run")
    kinds = [kind.split("/") for _, kind in load_published_numbers(REFERENCES).tally_by_fault_type]
    against = {
        "module": "vision_output",
        "fault_type": "relative_distance",
        "t_activation": 1,
        "h1": 1,
        "t_h1": 2,
        "fault_id": "against",
        "seed": 1,
    }
    all_kinds = [
        {"module": module, "fault_type": kind, "fault_id": str(i), "seed": i % 2}
        for i, (module, kind) in enumerate(kinds)
    ]
    frame = results(*all_kinds, against)  # decides the paper's second observation
    of_all = (REFERENCES / "paper_observations.yaml").read_text().count("mixture: true")
    assert of_all
    for done in (folder.planned_experiment_count - 1, folder.planned_experiment_count):
        done_results = pd.DataFrame({"status": ["ok"] * done})
        run = ReportedRun(
            folder=folder,
            workspace=toycar,
            results=done_results,
            frame=frame,
            published_work=None,
            experiment_facts=SEEN,
        )
        panel = build_observations_panel(run)
        assert panel is not None
        text = panel.files["observations.md"].decode()
        why = f"not enough data: only {done} of 12 planned experiments were run"
        assert text.count(why) == (0 if done == 12 else of_all)


def test_a_report_without_activated_faults_of_the_paper_has_no_observations(
    toycar: Workspace, tmp_path: Path
) -> None:
    shutil.copytree(REFERENCES, toycar.library / "references")
    freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)
    folder = RunFolder.open(tmp_path / "run")
    frame = results({"module": "radar", "fault_type": "chaff"})
    run = ReportedRun(
        folder=folder,
        workspace=toycar,
        results=frame,
        frame=frame,
        published_work=None,
        experiment_facts=SEEN,
    )
    assert build_observations_panel(run) is None


def test_claims_about_all_faults_are_not_decided_by_an_even_sample(toycar: Workspace, tmp_path: Path) -> None:
    shutil.copytree(REFERENCES, toycar.library / "references")
    folder = freeze_plan(build_plan(toycar, "small", Choices(limit=2)), tmp_path / "run", toycar)
    frame = results({"module": "radar", "fault_type": "chaff", "fault_id": "f", "seed": 1}).assign(weight=2.0)
    run = ReportedRun(
        folder=folder,
        workspace=toycar,
        results=pd.DataFrame({"status": ["ok"] * folder.head.experiments}),
        frame=frame,
        published_work=None,
        experiment_facts=SEEN,
    )
    assert "the experiments are an even sample" in list(_differences_from_papers_mixture(run, []))
