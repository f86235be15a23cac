"""A session whose work goes to workers of a cluster."""

from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.campaigns.chunks import pending_chunks_of
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.campaigns.run_provenance import append_session_environment
from mutator.execution.cluster.bundle import Bundle
from mutator.execution.cluster.worker_roster import WorkerRoster
from mutator.execution.written_files import WrittenFiles
from mutator.store.run_folder import RunFolder
from mutator.store.session_environments import SessionEnvironment
from mutator.workspace import Workspace


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path) -> RunFolder:
    return freeze_plan(build_plan(toycar, "small"), tmp_path / "run", toycar)


@pytest.fixture
def session(toycar: Workspace, folder: RunFolder, monkeypatch: pytest.MonkeyPatch) -> Any:
    """A session in which every experiment is pending, and the versions of workers are not checked."""
    monkeypatch.setattr(Bundle, "pack_for_run", lambda *arguments: Bundle(b"", ""))
    monkeypatch.setattr(WorkerRoster, "reason_to_refuse", lambda *arguments: "")
    numbers = count()
    folder = append_session_environment(folder, SessionEnvironment(python="", packages={}, platform=""))
    return SimpleNamespace(
        workspace=toycar,
        folder=folder,
        manifest=toycar.manifest("toycar"),
        pending=pending_chunks_of(folder, {}),
        proof=(),
        engine="fork",
        accept_versions=True,
        unused_worker_name=lambda name: f"0001-{name}{next(numbers)}",
        written=WrittenFiles(),
        note_machine=lambda machine: None,
        problem="",
        interrupted=False,
        workers_note="",
    )
