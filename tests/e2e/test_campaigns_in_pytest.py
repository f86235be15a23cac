"""Campaigns as pytest sessions."""

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mutator.campaigns.chunks import PendingChunk
from mutator.execution.written_files import WrittenFiles
from mutator.execution.xdist_controller import CampaignController, register_controller
from mutator.workspace import Workspace

PLAIN = ("-p", "no:cacheprovider", "-p", "no:hypothesispytest", "--assert=plain")


def pytest_campaign(toy: Workspace, *words: object) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-m", "pytest", *PLAIN, *map(str, words)],
        env=os.environ | {"MUTATOR_ROOT": str(toy.library.parent)},
        cwd=toy.library.parent,
        capture_output=True,
        text=True,
        timeout=300,
    )


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["--campaign", "small"], 4, "--campaign needs --campaign-out DIR"),
        (["--campaign-out", "out"], 4, "--campaign-out without --campaign"),
        (["--require-reviewed"], 4, "--require-reviewed without --campaign"),
        (["--accept-versions"], 4, "--accept-versions without --campaign"),
        (["--campaign", "small", "--campaign-out", "out", "--require-reviewed"], 1, "not approved"),
        (["--campaign", "nosuch", "--campaign-out", "out"], 2, "no campaign 'nosuch'"),
        (["--campaign", "small", "--campaign-out", "tree"], 2, "has no run.json and is not empty (toycar)"),
        (["--campaign", "small", "--campaign-out", "newer", "-n", "2"], 2, "use a newer version of mutator"),
        (["--campaign", "unarmed", "--campaign-out", "out", "-n", "2"], 1, "canary: did not reach H3"),
    ],
)
def test_mistakes_under_pytest_have_clear_errors(
    toy: Workspace,
    words: list[str],
    code: int,
    told: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    root = toy.library.parent
    monkeypatch.chdir(root)
    monkeypatch.setenv("MUTATOR_ROOT", str(root))
    (root / "newer").mkdir()
    (root / "newer" / "run.json").write_text(json.dumps({"schema": "run/99"}))
    text = toy.campaign("small").read_text().replace("at_s: 1.0", "at_s: 5.9")
    (toy.library / "campaigns" / "unarmed.yaml").write_text(text)
    assert pytest.main([*PLAIN, *words]) == code
    printed = "".join(capfd.readouterr())
    assert printed.count(told) == 1, printed
    assert "Traceback" not in printed


def test_the_plugin_does_nothing_without_a_campaign(toy: Workspace) -> None:
    """The plugin imports no other part of the harness."""
    test = "import sys\n\ndef test_it():\n    assert 'mutator.execution.session' not in sys.modules\n"
    (toy.library.parent / "test_it.py").write_text(test)
    answer = pytest_campaign(toy, "test_it.py")
    assert "1 passed" in answer.stdout
    assert "experiments" not in answer.stdout


@pytest.mark.slow
def test_pytest_runs_a_campaign_in_one_process(toy: Workspace, tmp_path: Path) -> None:
    words = ("--campaign", "small", "--campaign-out", tmp_path / "run")
    answer = pytest_campaign(toy, *words)
    assert answer.returncode == 0, answer.stdout
    assert "6 passed" in answer.stdout
    assert "12 of 12 experiments done, 12 now" in answer.stdout
    stages = re.findall("^(checks|golden|tables)", answer.stdout, re.MULTILINE)
    assert stages == ["checks", "golden", "tables"]
    again = pytest_campaign(toy, *words, "-n", "1")
    assert again.returncode == 0, again.stdout
    assert "12 of 12 experiments done, 0 now" in again.stdout


@pytest.mark.parametrize(("given", "used"), [("loadfile", "load"), ("load", "load"), ("no", "no")])
def test_loadfile_distributes_chunks_over_all_workers(tmp_path: Path, given: str, used: str) -> None:
    """All chunks belong to one file."""
    registered: list[object] = []
    manager = SimpleNamespace(get_plugins=lambda: (), register=registered.append)
    options = SimpleNamespace(dist=given)
    config: Any = SimpleNamespace(option=options, known_args_namespace=options, pluginmanager=manager)
    register_controller(
        config, "small", tmp_path, reviewed=False, accept_versions=False, sandbox=False, reuse=True
    )
    assert config.option.dist == used
    assert len(registered) == 1


class Counting:
    def __init__(self) -> None:
        self.items = 0
        self.seconds = 0.0
        self._began = time.monotonic()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.items = len(session.items)
        self.seconds = time.monotonic() - self._began


def test_collecting_50000_experiments_is_fast(toy: Workspace, tmp_path: Path) -> None:
    """Collecting 2,500 chunks opens neither plan nor target nor library."""
    begun: Any = SimpleNamespace(
        folder=SimpleNamespace(path=tmp_path / "nowhere"),
        pending=tuple(PendingChunk(chunk, tuple(range(20))) for chunk in range(2500)),
        proof=(),
        engine="reference",
        golden_digests={},
        reuse=None,
        secret=b"",
        written=WrittenFiles(),
        problem="",
        interrupted=False,
    )
    words = ["--campaign", "x", "--campaign-out", str(tmp_path), "--collect-only", "-qq", "--noconftest"]
    alone = ["-c", os.devnull, "-p", "no:cacheprovider", "--disable-plugin-autoload", "-p", "mutator"]
    counting = Counting()
    pytest.main([*words, *alone], plugins=[CampaignController(begun), counting])
    assert counting.items == 2500
    assert counting.seconds < 5.0
