"""Fixtures shared by the tests of the controller and its simulator."""

import fcntl
from pathlib import Path

import pytest
from selfdrive.sim import compile_helpers


@pytest.fixture(scope="session")
def all_compiled(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Path:
    """A folder with all C helpers, compiled once for all workers. Tests must not write into it."""
    own = tmp_path_factory.getbasetemp()
    shared = own if worker_id == "master" else own.parent
    folder = shared / "compiled"
    with (shared / "compiled.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            made = tmp_path_factory.mktemp("compiled")
            list(compile_helpers.compile_helpers(made))
            made.rename(folder)
    return folder
