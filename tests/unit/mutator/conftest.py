"""Fixtures for unit tests: workspaces and a fork engine."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from mutator.workspace import Workspace

from .fork_on_toy import Edit, Fork

HERE = Path(__file__).parent
CLONE = HERE.parents[2]


@pytest.fixture
def toy(tmp_path: Path) -> Workspace:
    root = tmp_path / "toy"
    shutil.copytree(HERE / "toy", root, ignore=shutil.ignore_patterns("__pycache__"))
    return Workspace.find(root=root, templates=CLONE / "templates")


@pytest.fixture(scope="session")
def clone() -> Workspace:
    return Workspace.find(root=CLONE)


@pytest.fixture
def fork(toycar: Workspace, tmp_path: Path) -> Iterator[Fork]:
    made = Fork(toycar, tmp_path)
    yield made
    made.close()


@pytest.fixture
def edit(toycar: Workspace) -> Edit:
    def replaced(name: str, old: str, new: str) -> None:
        path = toycar.library.parent / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return replaced
