"""Checks that experiments do not wait for."""

import os
import signal
from pathlib import Path

import pytest

from mutator._common.folder_locks import lock_run_folder
from mutator.campaigns import run_environment
from mutator.execution.campaign_running import run_campaign
from mutator.preflight.checks_beside_experiments import begin_checks
from mutator.store import file_digests
from mutator.store.checks_file import CHECKS_FILE
from mutator.store.preflight_results import are_verdicts_provisional
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@pytest.mark.usefixtures("kept_checks")
def test_a_kill_during_checks_with_other_versions_leaves_no_older_checks(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Experiments that ran with the new versions are provisional then, and a resume runs the checks again,
    which the folder's digests allow.
    """
    out = tmp_path / "run"
    assert run_campaign(toycar, "small", out).exit_code == 0
    now = run_environment.environment_affecting_results()
    monkeypatch.setattr(run_environment, "environment_affecting_results", lambda: [now, "numpy 99"])
    if not (pid := os.fork()):
        try:
            with lock_run_folder(out):
                folder = RunFolder.open(out)
                begin_checks(toycar, folder, workers=1, notify=lambda progress: None, secret=b"s")
                os.kill(os.getpid(), signal.SIGKILL)
        finally:
            os._exit(9)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL
    folder = RunFolder.open(out)
    assert are_verdicts_provisional(folder)
    assert CHECKS_FILE not in file_digests.load_ledger(out).files
    summary = run_campaign(toycar, "small", out, workers=1, accept_versions=True)
    assert (summary.exit_code, summary.seal is not None) == (0, True)
    assert not are_verdicts_provisional(RunFolder.open(out))
