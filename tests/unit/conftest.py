"""The project's own library and templates, for unit tests."""

from pathlib import Path

import pytest

from mutator.workspace import Workspace

CLONE = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def clone() -> Workspace:
    return Workspace.find(root=CLONE)
