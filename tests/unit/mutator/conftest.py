"""A small foreign target with a library of its own, copied so that a test may change it."""

import shutil
from pathlib import Path

import pytest

from mutator.workspace import Workspace

HERE = Path(__file__).parent
CLONE = HERE.parents[2]


@pytest.fixture
def toy(tmp_path: Path) -> Workspace:
    """A workspace on a copy of the toy target and its library, with the real templates."""
    root = tmp_path / "toy"
    shutil.copytree(HERE / "toy", root, ignore=shutil.ignore_patterns("__pycache__"))
    return Workspace.find(root=root, templates=CLONE / "templates")


@pytest.fixture(scope="session")
def clone() -> Workspace:
    """The workspace that ships: library, templates and target of this clone."""
    return Workspace.find(root=CLONE)
