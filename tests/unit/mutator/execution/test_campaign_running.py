"""Campaigns that use a custom distributor of work."""

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from mutator.execution.campaign_running import run_campaign
from mutator.execution.session import Session
from mutator.execution.session_items import SessionItems
from mutator.store.session_progress import PROGRESS_FILE, read_session_progress
from mutator.workspace import Workspace

WORKER = """
import pickle, sys
from mutator.campaigns.run_inputs import RunInputs
from mutator.execution.item_running import ItemRunner, ItemsStart
from mutator.execution.worker import Worker

inputs, assignment, start, listed = pickle.load(sys.stdin.buffer)
worker = Worker(RunInputs.from_bytes(inputs), assignment)
runner = ItemRunner(worker.folder, ItemsStart.from_bytes(start), lambda: worker)
for item in listed:
    assert runner.run(item) == []
runner.prove_rest()
sys.stdout.buffer.write(pickle.dumps((runner.close(), set(sys.modules))))
"""


class InOrder:
    def run(self, session: Session) -> None:
        items = SessionItems(session=session)
        runner = items.start_here()
        for item in items.list_work().items:
            assert runner.run(item) == []
        items.close(runner, is_stopped=False)


class Elsewhere:
    """A distributor whose worker is a process of its own."""

    def __init__(self) -> None:
        self.loaded: set[str] = set()

    def run(self, session: Session) -> None:
        items, assignment = SessionItems(session=session), session.worker_assignment("mine")
        start, listed = items.start_for(None).to_bytes(), items.list_work().items
        work = (session.inputs.to_bytes(), assignment, start, listed)
        command = [sys.executable, "-c", WORKER]
        done = subprocess.run(command, input=pickle.dumps(work), stdout=subprocess.PIPE, check=True)
        written, self.loaded = pickle.loads(done.stdout)
        session.written.add_report(written)


class Idle:
    """A distributor that gives up immediately."""

    def run(self, session: Session) -> None:
        session.problem = "no machine answered"


@pytest.mark.slow
@pytest.mark.usefixtures("kept_checks")
def test_a_run_resumed_by_another_distributor_has_the_same_results(toycar: Workspace, tmp_path: Path) -> None:
    assert run_campaign(toycar, "small", tmp_path / "local").exit_code == 0
    summary = run_campaign(toycar, "small", tmp_path / "idle", distributor=Idle())
    assert (summary.exit_code, summary.done, summary.problem) == (3, 0, "no machine answered")
    left = read_session_progress(tmp_path / "idle")
    assert left is not None
    assert (left.progress.stage, left.problem) == ("tables", "no machine answered")
    summary = run_campaign(toycar, "small", tmp_path / "idle", distributor=InOrder())
    assert summary.exit_code == 0
    assert not (tmp_path / "idle" / PROGRESS_FILE).exists()
    local, other = (tmp_path / name / "results.csv" for name in ("local", "idle"))
    assert other.read_bytes() == local.read_bytes()


@pytest.mark.slow
@pytest.mark.usefixtures("kept_checks")
def test_a_worker_needs_no_reader_of_yaml(toycar: Workspace, tmp_path: Path) -> None:
    assert run_campaign(toycar, "small", tmp_path / "here", distributor=InOrder()).exit_code == 0
    elsewhere = Elsewhere()
    assert run_campaign(toycar, "small", tmp_path / "elsewhere", distributor=elsewhere).exit_code == 0
    here, other = (tmp_path / name / "results.csv" for name in ("here", "elsewhere"))
    assert other.read_bytes() == here.read_bytes()
    assert "libcst" in elsewhere.loaded
    assert not {"pydantic", "yaml", "mutator.workspace"} & elsewhere.loaded
