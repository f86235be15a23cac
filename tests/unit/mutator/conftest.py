"""Workspaces and a fork engine for unit tests. Targets are copied, so that tests can change them."""

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
    """A workspace on a copy of the toy target and its library, with the real templates."""
    root = tmp_path / "toy"
    shutil.copytree(HERE / "toy", root, ignore=shutil.ignore_patterns("__pycache__"))
    return Workspace.find(root=root, templates=CLONE / "templates")


@pytest.fixture(scope="session")
def clone() -> Workspace:
    """The shipped workspace of this clone."""
    return Workspace.find(root=CLONE)


@pytest.fixture
def fork(toycar: Workspace, tmp_path: Path) -> Iterator[Fork]:
    """A fork engine on the toy."""
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
