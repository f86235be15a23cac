"""Campaigns that use a custom distributor of work."""

from pathlib import Path

import pytest

from mutator.execution.running import run_campaign
from mutator.execution.session import Session
from mutator.execution.worker import Assignment, Worker
from mutator.workspace import Workspace


class InOrder:
    def run(self, session: Session) -> None:
        name = session.worker_name("mine")
        assignment = Assignment(
            run=session.folder.path,
            name=name,
            engine=session.engine,
            goldens=session.golden_digests,
            secret=session.secret,
        )
        worker = Worker(session.workspace, assignment)
        for piece in session.pending:
            worker.run(piece)
        for sample in session.proof:
            worker.prove(sample)
        worker.close()
        session.written.report(worker.written)


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
    summary = run_campaign(toycar, "small", tmp_path / "idle", distributor=InOrder())
    assert summary.exit_code == 0
    local, other = (tmp_path / name / "results.csv" for name in ("local", "idle"))
    assert other.read_bytes() == local.read_bytes()
