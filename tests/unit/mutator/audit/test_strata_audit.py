"""Strata with other sizes are found, although the seal does not cover them."""

from dataclasses import replace
from pathlib import Path

import pytest

from mutator.audit.strata_audit import drawn_strata_problems, planned_strata_problems
from mutator.campaigns.plan import build_plan, load_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.store.plan_choices import Choices
from mutator.store.plan_strata import STRATA_FILE, load_strata
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path) -> RunFolder:
    choices = Choices(limit=6, proportional=True)
    return freeze_plan(build_plan(toycar, "small", choices), tmp_path / "run", toycar)


def write_sizes(folder: RunFolder, change: int) -> None:
    strata = load_strata(folder.path)
    assert strata is not None
    sizes = {name: size + change for name, size in strata.size_by_stratum.items()}
    (folder.path / STRATA_FILE).write_bytes(replace(strata, size_by_stratum=sizes).file_bytes())


def test_strata_as_planned_have_no_problem(toycar: Workspace, folder: RunFolder) -> None:
    assert not [*planned_strata_problems(folder, load_plan(folder)), *drawn_strata_problems(folder, toycar)]


def test_larger_strata_are_found_by_planning_again(toycar: Workspace, folder: RunFolder) -> None:
    write_sizes(folder, +5)
    assert not list(planned_strata_problems(folder, load_plan(folder)))
    [problem] = drawn_strata_problems(folder, toycar)
    assert "before the draw" in str(problem)


def test_strata_smaller_than_their_sample_are_found_without_a_library(folder: RunFolder) -> None:
    plan = load_plan(folder)
    strata = load_strata(folder.path)
    assert strata is not None
    gone = replace(strata, size_by_stratum=dict([next(iter(strata.size_by_stratum.items()))]))
    (folder.path / STRATA_FILE).write_bytes(gone.file_bytes())
    problems = list(planned_strata_problems(folder, plan))
    assert problems and all("at least" in str(problem) for problem in problems)


def test_a_run_without_a_sample_has_nothing_to_check(toycar: Workspace, tmp_path: Path) -> None:
    folder = freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)
    assert not [*planned_strata_problems(folder, load_plan(folder)), *drawn_strata_problems(folder, toycar)]
