"""Commands in a folder that a stranger filled run none of its code except the target's."""

import os
import subprocess
from pathlib import Path

import pytest

from mutator.execution.cluster import connecting

from .conftest import Cli

MODULES = ("json", "typing", "socket", "multiprocessing", "_pytest", "execnet", "numpy", "sitecustomize")
IDENTITY = ("-c", "user.name=x", "-c", "user.email=x@example.org", "-c", "commit.gpgsign=false")
PYTEST = "[pytest]\naddopts = --no-such-option\n"


@pytest.fixture
def hostile(root: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The library's folder as the current one, with modules and files of pytest that leave a mark."""
    for name in (*MODULES, "conftest"):
        (root / f"{name}.py").write_text(f"open({str(root / 'ran')!r}, 'a').write('{name} ')\n")
    (root / "pytest.ini").write_text(PYTEST)
    monkeypatch.chdir(root)
    return root


def test_workers_import_nothing_from_the_current_folder(cli: Cli, hostile: Path) -> None:
    answer = cli("run", "small", "--out", "run", "-n", "1", "--limit", "1", "--engine", "fork")
    assert answer.code == 0, answer.err
    assert not (hostile / "ran").exists()


@pytest.mark.slow
def test_workers_of_a_cluster_import_nothing_from_the_current_folder(cli: Cli, hostile: Path) -> None:
    answer = cli("run", "small", "--out", "run", "--cluster", "local:1", "--limit", "1")
    assert answer.code == 0, answer.err
    assert not (hostile / "ran").exists()


@pytest.mark.slow
def test_no_verb_runs_a_program_that_the_librarys_clone_names(cli: Cli, root: Path) -> None:
    ran, script, run = root.parent / "ran", root.parent / "evil", root.parent / "run"
    script.write_text(f"#!/bin/sh\necho $0 $* >> {ran}\n")
    script.chmod(0o755)
    for words in (("init", "-q"), ("add", "."), (*IDENTITY, "commit", "-qm", "all of it")):
        subprocess.run(["git", "-C", root, *words], check=True)
    (root / "more").write_text(f"[core]\n\tfsmonitor = {script}\n\thooksPath = {root}/hooks\n")
    (root / ".gitattributes").write_text("* filter=evil diff=evil\n")
    (root / "hooks").mkdir()
    for hook in ("post-index-change", "fsmonitor-watchman", "reference-transaction"):
        (root / "hooks" / hook).symlink_to(script)
    filters = ("filter.evil.clean", "filter.evil.process", "diff.evil.textconv", "diff.external")
    for name in (*filters, "gpg.program", "gpg.ssh.program", "core.pager", "core.editor"):
        subprocess.run(["git", "-C", root, "config", name, script], check=True)
    for name, value in (("include.path", root / "more"), ("log.showSignature", "true")):
        subprocess.run(["git", "-C", root, "config", name, value], check=True)
    (root / "fault_library/reviews").mkdir()
    head = 'schema: review/2\ntarget: "toycar"\nfour_eyes: true\ndecisions: []\n'
    (root / "fault_library/reviews/toycar.yaml").write_text(head)
    (root / "fault_library/faults/sensor/lane.yaml").touch()

    assert cli("run", "small", "--out", run, "-n", "0", "--limit", "2", "--no-stills").code == 0
    [experiment, *_] = (line.split(",")[0] for line in (run / "results.csv").read_text().splitlines()[1:])
    tried = ("try", "sensor/lane", "--scenario", "A", "--trigger", "1.0", "--out", root.parent / "tried")
    for words in (
        ("plan", "small", "--out", root.parent / "planned"),
        ("review", "list"),
        ("review", "approve", "--only", 'state == "new"', "--by", "Jane", "--yes"),
        ("review", "status"),
        ("diff", "sensor/lane"),
        tried,
        ("rerun", experiment, "--run", run),
        ("verify", run, "--rerun", "1"),
        ("report", run),
        ("check",),
        ("doctor",),
    ):
        answer = cli(*words)
        assert answer.code == 0, (words, answer.err)
    assert not ran.exists(), ran.read_text()


def test_processes_that_dask_starts_get_a_safe_path(monkeypatch: pytest.MonkeyPatch) -> None:
    for before in (None, "0"):
        if before is not None:
            monkeypatch.setenv("PYTHONSAFEPATH", before)
        with connecting.own_scheduler():
            assert os.environ["PYTHONSAFEPATH"] == "1"
        assert os.environ.get("PYTHONSAFEPATH") == before
