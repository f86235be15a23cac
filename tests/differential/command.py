"""A campaign command in a separate process that tests can signal and inspect."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from mutator.workspace import Workspace

LINGER_S = 5.0  # time for a command's other processes to end after it
DERIVED = ("results.csv", "results.parquet", "propagation.parquet")
Bytes = dict[str, bytes]


def results(out: Path) -> Bytes:
    series = {path.name: path.read_bytes() for path in (out / "series").iterdir()}
    assert "index.js" in series
    return series | {name: (out / name).read_bytes() for name in DERIVED}


def pytest_words(out: Path, campaign: str | Path = "small", workers: int = 2) -> list[str]:
    plain = ["-m", "pytest", "-p", "no:cacheprovider", "-p", "no:hypothesispytest", "--assert=plain"]
    return [*plain, f"--campaign={campaign}", f"--campaign-out={out}", "-n", str(workers)]


class Command:
    def __init__(self, workspace: Workspace, out: Path, *words: str, **environment: str) -> None:
        self.out = out
        self.mark = f"MUTATOR_TEST={os.urandom(8).hex()}"
        name, _, value = self.mark.partition("=")
        places = {"MUTATOR_LIBRARY": str(workspace.library), "MUTATOR_TEMPLATES": str(workspace.templates)}
        self.process = subprocess.Popen(
            [sys.executable, *words],
            env=os.environ | places | environment | {name: value},
            cwd=workspace.library.parent,
            start_new_session=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def wait_for_records(self, count: int) -> None:
        files = self.out / "records"
        self._wait(lambda: sum(p.read_bytes().count(b"\n") - 1 for p in files.glob("*.jsonl")) >= count)

    def wait_for(self, path: Path) -> None:
        self._wait(path.exists)

    def _wait(self, reached: Callable[[], bool]) -> None:
        deadline = time.monotonic() + 300.0  # on a busy machine, the first record once took over 120 s
        while not reached():
            assert self.process.poll() is None, self.process.communicate()[0]
            assert time.monotonic() < deadline
            time.sleep(0.01)

    def others(self) -> Iterator[tuple[int, str]]:
        """Yield the other living processes of the command, found by its mark or its run folder, with their
        command lines."""
        out = str(self.out).encode()
        for folder in Path("/proc").glob("[0-9]*"):
            try:
                pid = int(folder.name)
                if pid in (os.getpid(), self.process.pid):
                    continue
                line = (folder / "cmdline").read_bytes()
                told = (line, (folder / "environ").read_bytes(), os.fsencode((folder / "cwd").readlink()))
                if any(self.mark.encode() in text or out in text for text in told):
                    yield pid, line.replace(b"\0", b" ").decode()
            except OSError:
                continue

    def workers(self) -> list[int]:
        registered = {path.name for path in (self.out / "workers").glob("[0-9]*")}
        return sorted(pid for pid, _ in self.others() if str(pid) in registered)

    def end(self, *, longest_s: float = 600.0) -> str:
        printed = self.process.communicate(timeout=longest_s)[0]
        deadline = time.monotonic() + LINGER_S
        while left := list(self.others()):
            assert time.monotonic() < deadline, left
            time.sleep(0.05)
        return printed

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()
        while left := list(self.others()):
            for pid, _ in left:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.05)
