"""A whole campaign gives the same results on each engine, even after kills."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from mutator._common.folder_locks import living_worker_pids, wait_for_workers
from mutator.execution.campaign_running import run_campaign
from mutator.preflight.equivalence_check import EquivalenceResult
from mutator.store.records import load_records
from mutator.workspace import Workspace

TABLES = ("results.csv", "results.parquet", "propagation.parquet")


@pytest.fixture(scope="module")
def expected(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("reference")
    run_campaign(copy_toycar(folder), "toy", folder / "run", engine="reference")
    return {name: (folder / "run" / name).read_bytes() for name in TABLES}


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "workers"), [("fork", 0), ("fork", 2), ("warm", 2)])
def test_every_engine_gives_the_same_tables(
    toy: Workspace, tmp_path: Path, expected: dict[str, bytes], engine: str, workers: int
) -> None:
    summary = run_campaign(toy, "toy", tmp_path / "run", engine=engine, workers=workers)
    assert (summary.exit_code, summary.problem) == (0, "")
    assert summary.proof == EquivalenceResult(sampled=20, same=20)
    assert {name: (tmp_path / "run" / name).read_bytes() for name in TABLES} == expected


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["fork_server", "worker"])
def test_killing_servers_or_workers_changes_no_table(
    toy: Workspace, tmp_path: Path, expected: dict[str, bytes], victim: str
) -> None:
    out = tmp_path / "run"
    for _ in range(3):
        process = _begun(toy, out)
        done = len(load_records(out)) if out.exists() else 0
        while process.poll() is None:
            time.sleep(0.02)
            if out.exists() and len(load_records(out)) > done + 2:
                done = len(load_records(out))
                for pid in _victims(out, victim):
                    with suppress(ProcessLookupError):  # it might have ended with another worker
                        os.kill(pid, signal.SIGKILL)
        process.wait()
    summary = run_campaign(toy, "toy", out, engine="fork")
    assert (summary.exit_code, summary.done) == (0, 24)
    assert {name: (out / name).read_bytes() for name in TABLES} == expected
    assert _victims(out, "fork_server") == []


@pytest.mark.slow
def test_an_equivalence_check_resumes_after_kills(
    toy: Workspace, tmp_path: Path, expected: dict[str, bytes]
) -> None:
    out, proved = tmp_path / "run", 0
    for _ in range(3):
        process = _begun(toy, out)
        while process.poll() is None and len(_proved(out)) < proved + 4:
            time.sleep(0.02)
        assert process.poll() is None, "the command ended before it could be killed"
        process.kill()
        process.wait()
        wait_for_workers(out, 15.0)
        proved = len(_proved(out))
    summary = run_campaign(toy, "toy", out, engine="fork")
    assert summary.proof == EquivalenceResult(sampled=20, same=20)
    assert len(_proved(out)) == 20
    assert {name: (out / name).read_bytes() for name in TABLES} == expected


def _begun(toy: Workspace, out: Path) -> "subprocess.Popen[bytes]":
    words = ("run", "toy", "--out", str(out), "-n", "2", "--engine", "fork")
    places = {"MUTATOR_LIBRARY": str(toy.library), "MUTATOR_TEMPLATES": str(toy.templates)}
    return subprocess.Popen(
        [sys.executable, "-m", "mutator", *words],
        env=os.environ | places,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _proved(out: Path) -> list[str]:
    """Return the lines of the proof without file headers."""
    files = (out / "proof").glob("*.jsonl")
    return [line for path in files for line in path.read_text().splitlines()[1:]]


def _victims(out: Path, kind: str) -> list[int]:
    if kind == "worker":
        return living_worker_pids(out)[:1]
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            line = (path / "cmdline").read_bytes()
        except OSError:
            continue
        if b"fork_server.py" in line and str(out).encode() in line:
            found.append(int(path.name))
    return sorted(found)
