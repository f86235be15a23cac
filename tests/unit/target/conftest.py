"""Fixtures shared by the tests of the controller and its simulator."""

from pathlib import Path

import pytest
from selfdrive.sim import compile_helpers


@pytest.fixture(scope="session")
def all_compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with all C helpers, compiled once. Tests must not write into it."""
    folder = tmp_path_factory.mktemp("compiled")
    list(compile_helpers.compile_helpers(folder))
    return folder
