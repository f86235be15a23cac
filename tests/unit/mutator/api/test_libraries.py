"""Create and check libraries from Python."""

from dataclasses import replace
from pathlib import Path

import pytest

import mutator
from mutator.errors import MutatorError
from mutator.workspace import Workspace


def test_a_library_is_made_once(tmp_path: Path) -> None:
    """The new folder is a workspace. A second library in the same folder does not overwrite it."""
    folder = mutator.init_library(tmp_path / "own")
    assert mutator.Workspace.find(folder).campaigns
    with pytest.raises(MutatorError, match="not empty"):
        mutator.init_library(folder)


def test_a_first_library_for_a_controller(tmp_path: Path) -> None:
    """A library for a target is a workspace with a manifest. Its only problems are placeholders to fill
    in."""
    (tmp_path / "tree").mkdir()
    (tmp_path / "tree" / "a.py").write_text("def control(x):\n    y = 2 * x\n    return y\n")
    folder = mutator.init_library(tmp_path / "own", target=tmp_path / "tree")
    workspace = mutator.Workspace.find(library=folder / "fault_library")
    assert list(workspace.targets) == ["a"]
    problems = mutator.check_library(workspace)
    assert problems
    assert all(problem.got.startswith("not filled in: ") and problem.line for problem in problems)


def test_problems_of_a_library_are_a_list(toycar: Workspace) -> None:
    """A broken spec adds one problem, which names the spec's file."""
    before = {problem.where for problem in mutator.check_library(toycar)}
    spec = toycar.spec("sensor/lane").path
    spec.write_text("nonsense: true\n")
    assert {problem.where for problem in mutator.check_library(toycar)} - before == {str(spec)}


def test_the_doctor_knows_a_library_that_is_missing(toycar: Workspace, tmp_path: Path) -> None:
    found = {f.name: f.level for f in mutator.doctor(tmp_path / "none")}
    assert found["library"] == "failed"
    assert {f.name for f in mutator.doctor(toycar)} >= {"library"}


def test_an_analysis_is_asked_for(toycar: Workspace, tmp_path: Path) -> None:
    """Without a hazard analysis, checking or drawing it raises an error that says that it is missing."""
    (tmp_path / "empty").mkdir()
    with pytest.raises(MutatorError, match=r"no control_structure\.yaml"):
        mutator.draw_control_structure(replace(toycar, library=tmp_path / "empty"))
