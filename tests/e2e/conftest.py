"""A finished exploration of the toy, which several modules forge, and the toy with a family of scenarios."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.workspace import Workspace
from tests.e2e.exploration_forging import Explored, explore
from tests.e2e.toy_family import with_family


@pytest.fixture(scope="session")
def exploration(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Explored:
    place = tmp_path_factory.mktemp("explored")
    workspace = copy_toycar(place)
    explore(workspace, place / "run")
    return workspace, place / "run"


@pytest.fixture
def explored_run(exploration: Explored, tmp_path: Path) -> Path:
    """A copy of the run folder, to be edited."""
    return Path(shutil.copytree(exploration[1], tmp_path / "run"))


@pytest.fixture
def families(toy: Workspace) -> Workspace:
    """The toy car with a family, and a campaign in its scenarios and in A."""
    return with_family(toy)
