"""The guard of a job ends the job's processes when the server ends."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

# A guard for a command that is not mutator, with a shorter timeout.
GUARD = """
import os, sys
from mutator.serve import job_guard
job_guard.MOST_CLEANUP_S = float(sys.argv.pop())
execv = os.execv
job_guard.os.execv = lambda path, words: execv(path, [path, "-c", *words[4:]])
sys.exit(job_guard.main())
"""
# Starts a process in another session, reports it, and waits. `{}` is the reaction to a request to end.
COMMAND = """
import pathlib, signal, subprocess, sys, time
def end(number, frame):
    {}
signal.signal(signal.SIGTERM, end)
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(100)"], start_new_session=True)
pathlib.Path("pids").write_text(f"{{child.pid}} ")
pathlib.Path("pids").rename("started")
time.sleep(100)
"""
IN_ORDER = "pathlib.Path('ended').touch(); sys.exit(0)"


def eventually(holds: Callable[[], bool]) -> bool:
    deadline = time.monotonic() + 20
    while not holds() and time.monotonic() < deadline:
        time.sleep(0.02)
    return holds()


def start_guarded(folder: Path, script: str, patience_s: float = 10.0) -> tuple[subprocess.Popen[bytes], int]:
    watched, hold = os.pipe()
    words = [sys.executable, "-c", GUARD, str(watched), script, str(patience_s)]
    keeper = subprocess.Popen(words, cwd=folder, pass_fds=[watched], start_new_session=True)
    os.close(watched)
    return keeper, hold


def is_gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].startswith("Z")
    except OSError:
        return True


def child_of(folder: Path) -> int:
    assert eventually((folder / "started").exists)
    return int((folder / "started").read_text())


def test_a_command_is_asked_to_end_when_its_server_ends(tmp_path: Path) -> None:
    keeper, hold = start_guarded(tmp_path, COMMAND.format(IN_ORDER))
    child = child_of(tmp_path)
    os.close(hold)
    assert keeper.wait(20) == 0
    assert (tmp_path / "ended").exists()
    assert is_gone(child)


def test_a_command_that_does_not_end_is_killed(tmp_path: Path) -> None:
    keeper, hold = start_guarded(tmp_path, COMMAND.format("pass"), patience_s=0.2)
    child = child_of(tmp_path)
    os.close(hold)
    assert keeper.wait(20) == 128 + signal.SIGKILL
    assert is_gone(child)


def test_a_command_dies_with_its_guard(tmp_path: Path) -> None:
    keeper, hold = start_guarded(tmp_path, COMMAND.format(IN_ORDER))
    child = child_of(tmp_path)
    [command] = Path(f"/proc/{keeper.pid}/task/{keeper.pid}/children").read_text().split()
    keeper.kill()
    keeper.wait()
    assert eventually(lambda: is_gone(int(command)))
    os.close(hold)
    os.kill(child, signal.SIGKILL)  # the command died without ending its child


@pytest.mark.parametrize("code", [0, 1, 3])
def test_the_guard_exits_with_the_commands_code(tmp_path: Path, code: int) -> None:
    keeper, hold = start_guarded(tmp_path, f"raise SystemExit({code})")
    assert keeper.wait(20) == code
    os.close(hold)
