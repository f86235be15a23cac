"""Commands in a folder that a stranger filled run none of its code except the target's."""

import os
from pathlib import Path

import pytest

from mutator.execution.cluster import connecting

from .conftest import Cli

MODULES = ("json", "typing", "socket", "multiprocessing", "_pytest", "execnet", "numpy", "sitecustomize")
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


def test_processes_that_dask_starts_get_a_safe_path(monkeypatch: pytest.MonkeyPatch) -> None:
    for before in (None, "0"):
        if before is not None:
            monkeypatch.setenv("PYTHONSAFEPATH", before)
        with connecting.own_scheduler():
            assert os.environ["PYTHONSAFEPATH"] == "1"
        assert os.environ.get("PYTHONSAFEPATH") == before
