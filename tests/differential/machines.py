"""A Dask scheduler and workers as separate processes, each with its own folders and caches."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

_QUIET = {"DASK_LOGGING__DISTRIBUTED": "error"}


@dataclass
class Machines:
    folder: Path
    nanny: bool = True  # restarts dead workers
    environment: Mapping[str, str] = field(default_factory=dict)
    workers: dict[str, subprocess.Popen[bytes]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        self.file = self.folder / "scheduler.json"
        self.start_scheduler()

    def start_scheduler(self) -> None:
        self.file.unlink(missing_ok=True)
        words = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file)]
        self.scheduler = self._started("scheduler", words)
        deadline = time.monotonic() + 60.0
        while not self.file.exists():
            assert time.monotonic() < deadline and self.scheduler.poll() is None, "no scheduler started"
            time.sleep(0.05)

    def add(self, name: str, **environment: str) -> None:
        words = ["--scheduler-file", str(self.file), "--name", name, "--nthreads", "1", "--no-dashboard"]
        words += ["--host", "127.0.0.1", "--memory-limit", "0", "--nanny" if self.nanny else "--no-nanny"]
        words += ["--local-directory", str(self.folder / name / "dask"), "--death-timeout", "60"]
        self.workers[name] = self._started("worker", words, name, **environment)

    def strike(self, name: str, number: signal.Signals) -> None:
        """Send a signal to a worker's process, not to its nanny."""
        for pid in self.processes(name):
            os.kill(pid, number)

    def processes(self, name: str) -> list[int]:
        """Return the id of the process that does a worker's work, or nothing while its nanny restarts it."""
        process = self.workers[name]
        if not self.nanny:
            return [process.pid]
        found = []
        for path in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words, stat = path.read_bytes(), (path.parent / "stat").read_text()
            except OSError:
                continue
            if int(stat.rpartition(")")[2].split()[1]) == process.pid and b"spawn_main" in words:
                found.append(int(path.parent.name))
        return found

    def children(self) -> list[int]:
        found = []
        for path in Path("/proc").glob("[0-9]*"):
            try:
                mine = f"MACHINES={self.folder}".encode() in (path / "environ").read_bytes()
                ours = mine and b"mutator.execution.cluster.piece_process" in (path / "cmdline").read_bytes()
            except OSError:
                continue
            if ours:
                found.append(int(path.name))
        return found

    def end(self) -> None:
        for process in (*self.workers.values(), self.scheduler):
            for number in (signal.SIGCONT, signal.SIGKILL):
                try:
                    os.killpg(process.pid, number)
                except ProcessLookupError:
                    break
            process.wait()
        for pid in self.children():
            os.kill(pid, signal.SIGKILL)
        shutil.rmtree(self.folder, ignore_errors=True)

    def _started(
        self, what: str, words: list[str], name: str = "", **environment: str
    ) -> subprocess.Popen[bytes]:
        own = self.folder / (name or what)
        (own / "home").mkdir(parents=True, exist_ok=True)
        places = {
            "HOME": str(own / "home"),
            "XDG_CACHE_HOME": str(own / "cache"),
            "MACHINES": str(self.folder),
        }
        places |= {"XDG_DATA_HOME": str(own / "data"), "TMPDIR": str(own)}
        log = (own / "log").open("wb")
        return subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.dask_{what}", *words],
            env=os.environ | _QUIET | places | dict(self.environment) | environment,
            cwd=own,
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
        )
