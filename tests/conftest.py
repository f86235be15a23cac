"""Fixtures that several kinds of tests share."""

import shutil
from pathlib import Path

import pytest

from mutator.workspace import Workspace

_TESTS = Path(__file__).parent


@pytest.fixture
def toy(tmp_path: Path) -> Workspace:
    """A copy of the toy target's library and tree, with the project's templates and the hostile ones."""
    shutil.copytree(
        _TESTS / "toy", tmp_path / "toy", ignore=shutil.ignore_patterns("__pycache__", "templates")
    )
    templates = tmp_path / "toy" / "templates"
    shutil.copytree(_TESTS.parent / "templates", templates)
    shutil.copytree(_TESTS / "toy" / "templates", templates, dirs_exist_ok=True)
    return Workspace(library=tmp_path / "toy" / "fault_library", templates=templates)
