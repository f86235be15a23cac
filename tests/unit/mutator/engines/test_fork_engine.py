"""The fork engine's server processes: their number, their starting points, and what happens if one is
killed."""

import marshal
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.engines import fork_server_processes
from mutator.engines.engine_jobs import RunMode
from mutator.engines.first_activation import GoldenObservations
from mutator.model import Status, Trigger
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

from ..fork_on_toy import LIMITS, Edit, Fork
from .ended_processes import ended


def test_forking_processes_have_one_thread_and_end_with_the_engine(fork: Fork) -> None:
    for time_s in (2.0, 4.0, 3.0):
        assert fork.run(fork.job(trigger_at_time(time_s))).mode is RunMode.FORK
    pids = fork.processes()
    assert len(pids) >= 4, "expected the guard, the server, and golden runs that wait at several steps"
    for pid in pids:
        status = Path(f"/proc/{pid}/status").read_text()
        assert "\nThreads:\t1\n" in status
    fork.close()
    assert all(map(ended, pids))
    assert [path.name for path in (fork.folder / "work").iterdir() if "server" in path.name] == []


def test_a_fork_starts_just_before_its_fault_and_few_processes_wait(fork: Fork) -> None:
    starts = [fork.run(fork.job(trigger_at_time(0.05 * step))).fork_step for step in (40, 41, 90, 10, 100, 0)]
    assert starts == [40, 41, 90, 10, 100, 0]
    for step in range(3, 100, 9):
        fork.run(fork.job(trigger_at_time(0.05 * step)))
    assert len(fork.processes()) <= 10


def test_starts_in_any_order_are_forked(fork: Fork, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that ends leaves those that it forked to one that drives on, which does not take them for
    processes of the target.
    """
    fork.most_waiting_processes = 3
    monkeypatch.setattr(fork_server_processes, "_MOST_STEPS_TO_ADVANCE", 0)
    steps = list(range(1, 101, 6))
    random.Random(1).shuffle(steps)
    results = [fork.run(fork.job(trigger_at_time(0.05 * step))) for step in steps]
    assert {result.fallback_reason for result in results} == {""}


def test_libraries_that_the_golden_run_imports_late_are_loaded_before_the_fork(fork: Fork) -> None:
    fork.run(fork.job(trigger_at_time(2.0)))
    (seen,) = fork.engine._observations_by_golden.values()
    assert isinstance(seen, GoldenObservations)
    assert "zipfile" in seen.imported_modules  # imported only to write the trace
    assert not any(name.startswith("toycar") for name in seen.imported_modules)
    assert all(
        set(seen.imported_modules) <= waiting.loaded_modules
        for waiting in fork.pool._waiting_processes
        if waiting.step
    )


def test_an_experiment_that_never_triggers_gets_the_files_of_the_golden_run(fork: Fork) -> None:
    execution = fork.run(fork.job(trigger_at_time(100.0)))
    assert (execution.mode, execution.status, execution.cpu_s) == (RunMode.GOLDEN_REUSED, Status.OK, 0.0)
    assert execution.out == fork.golden


def test_a_killed_process_causes_a_harness_error_for_one_job_only(fork: Fork) -> None:
    job = fork.job(trigger_at_time(2.0))
    for place in (0, -1):  # the first process, then a waiting one
        assert fork.run(job).status is Status.OK
        victims = fork.processes()
        os.kill(victims[place], signal.SIGKILL)
        assert ended(victims[place])
        time.sleep(0.1)
        execution = fork.run(job)
        if execution.status is Status.OK:  # a waiting process could still run the job
            assert place == 0
            execution = fork.run(fork.job(Trigger(name="x", condition="t >= 0.01")))
        assert execution.status is Status.HARNESS_ERROR
        assert "fork server" in execution.detail
        assert fork.run(job).status is Status.OK
        assert all(map(ended, victims)), "a process of the killed server is still running"


def test_waiting_processes_end_with_the_server(fork: Fork) -> None:
    fork.run(fork.job(trigger_at_time(2.0)))
    guard, first, *waiting = fork.processes()
    assert guard == fork.pool._process.pid
    assert waiting
    os.kill(first, signal.SIGKILL)
    assert all(map(ended, (guard, *waiting)))


def test_a_killed_guard_is_reported_by_the_next_run(fork: Fork) -> None:
    fork.run(fork.job(trigger_at_time(2.0)))
    pids = fork.processes()
    os.kill(fork.pool._process.pid, signal.SIGKILL)
    assert ended(fork.pool._process.pid)
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert (execution.status, execution.detail) == (Status.HARNESS_ERROR, "the fork server is gone")
    assert all(map(ended, pids))


ENGINE = """
import sys, time
from pathlib import Path
from mutator.workspace import Workspace
sys.path.insert(0, sys.argv[4])
from fork_on_toy import Fork
from mutator.triggers.trigger_kinds import trigger_at_time
toy = Workspace(library=Path(sys.argv[1]), templates=Path(sys.argv[2]))
fork = Fork(toy, Path(sys.argv[3]))
print(fork.run(fork.job(trigger_at_time(2.0))).mode, flush=True)
time.sleep(60)
"""


@pytest.mark.slow
def test_the_server_ends_when_its_engine_is_killed(toycar: Workspace, tmp_path: Path) -> None:
    arguments = [toycar.library, toycar.templates, tmp_path, Path(__file__).parents[1]]
    engine = subprocess.Popen(
        [sys.executable, "-c", ENGINE, *map(str, arguments)], stdout=subprocess.PIPE, text=True
    )
    try:
        assert engine.stdout is not None
        assert engine.stdout.readline() == "fork\n"
        pids = [pid for pid in Fork(toycar, tmp_path).processes() if pid != engine.pid]
        assert len(pids) >= 2
    finally:
        engine.kill()
        engine.communicate()
    assert all(map(ended, pids))


@pytest.mark.slow
def test_the_cpu_limit_of_a_fork_excludes_the_time_before_it(fork: Fork, edit: Edit) -> None:
    edit(
        "tree/toycar/world.py",
        "        now = self.frame",
        "        sum(range(1_500_000))\n        now = self.frame",
    )
    assert fork.run(fork.job(trigger_at_time(5.5))).mode is RunMode.FORK
    fork.pool.close()
    fork.engine._server, fork.engine._limits = None, replace(LIMITS, cpu_s=1)
    execution = fork.run(fork.job(trigger_at_time(5.5)))
    assert (execution.mode, execution.status) == (RunMode.FORK, Status.OK)
    execution = fork.run(fork.job(trigger_at_time(0.5)))
    assert (execution.mode, execution.status) == (RunMode.FORK, Status.TIMEOUT)
    assert execution.detail == "CPU time limit of 1 s"


def test_a_server_whose_first_message_was_exchanged_is_not_used(
    fork: Fork, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another run writes to the file before the server reads it, and puts it back afterwards."""
    start, welcome = subprocess.Popen, fork_server_processes.ForkServer._receive_welcome
    originals: dict[Path, bytes] = {}

    def forging(command: list[str], **more: object) -> object:
        path = Path(command[-1])
        if path.name == "start.marshal":
            originals[path] = path.read_bytes()
            path.write_bytes(marshal.dumps(marshal.loads(originals[path]) | {"packages": []}))
        return start(command, **more)  # type: ignore[call-overload]

    def putting_back(pool: fork_server_processes.ForkServer) -> None:
        reply = pool.first_process.receive_reply
        monkeypatch.setattr(
            pool.first_process, "receive_reply", lambda patience_s: (reply(patience_s), restore())[0]
        )
        welcome(pool)

    def restore() -> None:
        for path, data in originals.items():
            path.write_bytes(data)

    monkeypatch.setattr(fork_server_processes.subprocess, "Popen", forging)
    monkeypatch.setattr(fork_server_processes.ForkServer, "_receive_welcome", putting_back)
    execution = fork.run(fork.job(trigger_at_time(2.0)))
    assert execution.status is Status.HARNESS_ERROR and originals
    assert execution.detail == "the tree of the fork server is not the pristine one"
