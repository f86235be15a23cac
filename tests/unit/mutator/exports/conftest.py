"""What the tests of exports share."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.workspace import Workspace


@pytest.fixture(scope="module")
def workspace(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> Workspace:
    """The toy car in a repository of its user."""
    toycar = copy_toycar(tmp_path_factory.mktemp("repository"))
    (toycar.library.parent / ".git").mkdir()
    return toycar
