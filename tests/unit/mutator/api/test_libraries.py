"""Create and check libraries from Python."""

from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_a_second_library_does_not_overwrite_the_first(tmp_path: Path) -> None:
    folder = mutator.init_library(tmp_path / "own")
    assert mutator.Workspace.find(folder).campaigns
    with pytest.raises(MutatorError, match="not empty"):
        mutator.init_library(folder)


def test_a_new_library_for_a_controller_is_valid_except_for_placeholders(tmp_path: Path) -> None:
    (tmp_path / "tree").mkdir()
    (tmp_path / "tree" / "a.py").write_text("def control(x):\n    y = 2 * x\n    return y\n")
    folder = mutator.init_library(tmp_path / "own", target=tmp_path / "tree")
    workspace = mutator.Workspace.find(library=folder / "fault_library")
    assert list(workspace.targets) == ["a"]
    problems = mutator.check_library(workspace)
    assert problems
    assert all(problem.got.startswith("not filled in: ") and problem.line for problem in problems)


def test_a_broken_spec_adds_one_problem(toycar: Workspace) -> None:
    before = {problem.where for problem in mutator.check_library(toycar)}
    spec = toycar.spec("sensor/lane").path
    spec.write_text("nonsense: true\n")
    assert {problem.where for problem in mutator.check_library(toycar)} - before == {str(spec)}


def test_the_doctor_reports_a_missing_library(toycar: Workspace, tmp_path: Path) -> None:
    found = {f.name: f.level for f in mutator.doctor(tmp_path / "none")}
    assert found["library"] == "failed"
    assert {f.name for f in mutator.doctor(toycar)} >= {"library"}


def test_a_missing_hazard_analysis_is_an_error(toycar: Workspace, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with pytest.raises(MutatorError, match=r"no control_structure\.yaml"):
        mutator.draw_control_structure(replace(toycar, library=tmp_path / "empty"))
