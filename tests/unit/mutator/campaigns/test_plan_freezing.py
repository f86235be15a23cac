"""Freezing a plan: the content of the run folder, and when a plan can be frozen again."""

import csv
from pathlib import Path

import pytest

from mutator.campaigns.plan import build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.errors import MutatorError
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace


def test_a_frozen_plan_is_read_back_equal(toycar: Workspace, tmp_path: Path) -> None:
    plan = build_plan(toycar, "toy", Choices(limit=9))
    folder = freeze_plan(plan, tmp_path / "run", toycar)
    back = load_plan(folder)
    for name in ("experiments", "chunks", "canary", "digest", "seed", "reading", "choices"):
        assert getattr(back, name) == getattr(plan, name)
    rows = list(csv.DictReader((folder.path / "plan.csv").open()))
    assert [row["experiment_id"] for row in rows] == [e.id for e in plan.experiments]
    assert rows[0]["condition"] == plan.experiments[0].trigger.condition


def test_only_the_same_plan_can_be_frozen_again(toycar: Workspace, tmp_path: Path) -> None:
    freeze_plan(build_plan(toycar, "toy"), tmp_path / "run", toycar)
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "run").rglob("*") if p.name != "owner.lock"}
    freeze_plan(build_plan(toycar, "toy"), tmp_path / "run", toycar)
    assert before == {p: p.stat().st_mtime_ns for p in before}
    with pytest.raises(MutatorError, match="holds another plan"):
        freeze_plan(build_plan(toycar, "toy", Choices(seed=8)), tmp_path / "run", toycar)


@pytest.mark.parametrize("path", ["tree/toycar/driver.py", "templates/offset.py.j2"])
def test_a_run_does_not_resume_with_changed_sources(toycar: Workspace, tmp_path: Path, path: str) -> None:
    plan = build_plan(toycar, "toy")
    freeze_plan(plan, tmp_path / "run", toycar)
    with (toycar.library.parent / path).open("a") as file:
        file.write("\n# changed\n")
    with pytest.raises(MutatorError, match=r"changed since this run was planned: (target|templates)"):
        freeze_plan(plan, tmp_path / "run", toycar)


def test_a_folder_with_other_files_is_refused(toycar: Workspace, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").touch()
    for place in ("full", "full/thesis.tex"):
        with pytest.raises(MutatorError, match=r"not empty \(thesis\.tex\)"):
            freeze_plan(build_plan(toycar, "toy"), tmp_path / place, toycar)
    assert [p.name for p in (tmp_path / "full").iterdir()] == ["thesis.tex"]


def test_an_interrupted_freeze_can_be_repeated(toycar: Workspace, tmp_path: Path) -> None:
    plan = build_plan(toycar, "toy")
    freeze_plan(plan, tmp_path / "run", toycar)
    (tmp_path / "run" / "run.json").rename(tmp_path / "run" / ".run.json.4711")
    assert freeze_plan(plan, tmp_path / "run", toycar).planned_experiment_count == 24


def test_a_disk_limit_at_its_default_does_not_change_the_plan(toycar: Workspace, tmp_path: Path) -> None:
    path = toycar.campaign("small")
    text = path.read_text()
    before = freeze_plan(build_plan(toycar, "small"), tmp_path / "0", toycar)
    for number, (limit, is_same) in enumerate([(1024, True), (1025, False)], start=1):
        path.write_text(text.replace("limits: {", f"limits: {{disk_mb: {limit}, "))
        folder = freeze_plan(build_plan(toycar, "small"), tmp_path / str(number), toycar)
        assert (folder.head.plan == before.head.plan) is is_same
        assert (folder.head.limits == before.head.limits) is is_same
        assert folder.limits.disk_mb == limit
