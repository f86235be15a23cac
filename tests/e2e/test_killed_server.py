"""Killing the server leaves no job's processes and no half-written files, and the run folder verifies."""

import http.client
import json
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from mutator._common.files import is_half_written
from mutator.serve.job_guard import MOST_CLEANUP_S
from mutator.workspace import Workspace

CAMPAIGN = {"kind": "campaign", "campaign": "toy", "name": "new", "limit": 6, "workers": 2}


@dataclass
class Server:
    folder: Path
    root: Path
    process: subprocess.Popen[str]
    address: str

    @classmethod
    def start(cls, folder: Path, root: Path) -> "Server":
        return cls(folder, root, *started(folder, root))

    def restart(self) -> None:
        self.process, self.address = started(self.folder, self.root)

    @property
    def port(self) -> int:
        return int(re.findall(r":(\d+)/", self.address)[0])

    @property
    def token(self) -> str:
        return self.address.partition("token=")[2]

    def ask(self, path: str, body: Any = None) -> Any:
        return json.loads(self._answer(path, body))

    def _answer(self, path: str, body: Any = None) -> str:
        """Send a request as the script of the first page does."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=30)
        headers = {"Cookie": f"mutator-{self.port}={self.token}", "Content-Type": "application/json"}
        headers |= {"Origin": f"http://127.0.0.1:{self.port}"}
        if body is not None:
            [page] = re.findall(r'name="mutator-page" content="(\w+)"', self._answer("/"))
            headers |= {"X-Mutator-Page": page}
        data = None if body is None else json.dumps(body)
        connection.request("GET" if body is None else "POST", path, data, headers)
        answer = connection.getresponse().read().decode()
        connection.close()
        return answer

    def wait_for(self, what: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline:
            [job, *_] = self.ask("/api/jobs")["jobs"]
            if what(job):
                return dict(job)
            time.sleep(0.02)
        raise AssertionError(job)


def started(folder: Path, root: Path) -> tuple[subprocess.Popen[str], str]:
    with (folder / "stderr").open("a") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "mutator", "serve", "runs", "--no-browser", "--root", str(root)],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
    assert process.stdout is not None
    return process, process.stdout.readline().strip()


def descendants(pid: int) -> set[int]:
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(") ")[2].split()
        except OSError:
            continue
        parents[int(path.parent.name)] = int(fields[1])
    found: set[int] = {pid}
    while more := {one for one, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {pid}


def living(pids: set[int]) -> set[int]:
    return {pid for pid in pids if Path(f"/proc/{pid}").exists() and _state(pid) != "Z"}


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0]
    except OSError:
        return "Z"


def wait_until_gone(pids: set[int], within_s: float) -> None:
    deadline = time.monotonic() + within_s
    while left := living(pids):
        assert time.monotonic() < deadline, [Path(f"/proc/{pid}/cmdline").read_bytes() for pid in left]
        time.sleep(0.05)


def mutator(server: Server, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mutator", *words, "--root", str(server.root)]
    return subprocess.run(command, cwd=server.folder, capture_output=True, text=True, check=False)


def check_left(server: Server, run: str) -> None:
    folder = server.folder / "runs" / run
    assert not [path for path in folder.rglob("*") if is_half_written(path.name)]
    if (folder / "digests.json").exists():
        verified = mutator(server, "verify", f"runs/{run}")
        assert verified.returncode == 0, verified.stdout + verified.stderr


def kill(server: Server, number: int) -> int:
    """End the server by a signal and wait until the processes of its jobs are gone. Return their number."""
    pids = descendants(server.process.pid)
    server.process.send_signal(number)
    server.process.wait()
    wait_until_gone(pids, MOST_CLEANUP_S + 10)
    assert server.token not in (server.folder / "stderr").read_text()
    return len(pids)


@pytest.fixture
def server(tmp_path: Path, toycar: Workspace, kept_checks: None) -> Iterator[Server]:
    shutil.rmtree(toycar.library / "faults" / "hostile")
    (tmp_path / "runs").mkdir()
    started = Server.start(tmp_path, toycar.library.parent)
    yield started
    started.process.kill()
    started.process.wait()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("stage", ["planning", "experiments", "tables"])
def test_a_campaign_ends_with_the_server(server: Server, stage: str, number: int) -> None:
    server.ask("/api/jobs", CAMPAIGN)
    server.wait_for(lambda job: job["message"].startswith(stage) or bool(job["ended"]))
    assert kill(server, number)
    check_left(server, "new")
    done = mutator(server, "run", "toy", "--out", "runs/new", "--limit", "6", "-n", "2")
    assert done.returncode == 0, done.stdout + done.stderr
    check_left(server, "new")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["plot", "film", "still", "report", "rerun"])
def test_a_killed_job_leaves_the_run_folder_unchanged_or_complete(server: Server, kind: str) -> None:
    done = mutator(server, "run", "toy", "--out", "runs/new", "--limit", "6", "-n", "2")
    assert done.returncode == 0, done.stdout + done.stderr
    ids = [line.split(",")[0] for line in (server.folder / "runs/new/plan.csv").read_text().splitlines()[1:]]
    order = {"kind": kind, "run": "new"}
    order |= {} if kind == "report" else {"experiment": ids[0]}
    order |= {"t": 2.0} if kind == "still" else {}
    for _ in range(2):  # the second run has warm caches, like the killed ones
        began = time.monotonic()
        server.ask("/api/jobs", order)
        ended = server.wait_for(lambda job: bool(job["ended"]))
        assert ended["state"] == "done", ended
    whole, caught = time.monotonic() - began, 0
    for share in (0.3, 0.6, 0.8, 0.9):
        server.ask("/api/jobs", order)
        time.sleep(share * whole)
        caught += kill(server, signal.SIGKILL) > 0
        check_left(server, "new")
        server.restart()
    assert caught


@pytest.mark.slow
def test_a_cancelled_job_leaves_nothing_running(server: Server) -> None:
    server.ask("/api/jobs", CAMPAIGN)
    server.wait_for(lambda job: job["message"].startswith("experiments"))
    pids = descendants(server.process.pid)
    assert pids
    server.ask("/api/jobs/1/cancel", {})
    server.wait_for(lambda job: bool(job["ended"]))
    assert not living(pids)
    check_left(server, "new")
    server.ask("/api/jobs", CAMPAIGN)
    assert server.wait_for(lambda job: bool(job["ended"]))["state"] == "done"
    check_left(server, "new")
