"""The fork engine: its server's processes, what falls back, and what a kill leaves."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mutator import mutant
from mutator.campaign import Limits
from mutator.engine import Execution, How, Job, prepare_base
from mutator.fork_engine import ForkEngine
from mutator.fork_pool import Pool
from mutator.manifest import TargetManifest
from mutator.model import Anchor, AnchorKind, Fault, FaultLocation, Injection, Status, Trigger
from mutator.trigger import always, at_time
from mutator.workspace import Workspace

LIMITS = Limits(cpu_s=20, wall_s=60, memory_mb=1024, steps=500)
Edit = Callable[[str, str, str], None]


class Fork:
    """A fork engine on the toy; `manifest` is read when it is first needed, so files can be edited before."""

    def __init__(self, toy: Workspace, folder: Path) -> None:
        self.toy = toy
        self.folder = folder
        self.limits = LIMITS
        self._engine: ForkEngine | None = None

    @property
    def engine(self) -> ForkEngine:
        if self._engine is None:
            self.manifest: TargetManifest = self.toy.manifest("toycar")
            self.models = self.toy.fault_models()
            base = prepare_base(self.manifest, self.folder / "base")
            work = self.folder / "work"
            work.mkdir()
            null = mutant.build(self.manifest, self.models, None, always()).files
            self._engine = ForkEngine(self.manifest, base, work, self.limits, null=null)
            golden = Job(name="golden", scenario=self.toy.scenario("A"), seed=7)
            self.golden = self._engine.reference.execute(golden, self.folder / "golden").out
        return self._engine

    def job(self, trigger: Trigger, anchor: str = "gap", function: str = "Sensor.sense") -> Job:
        _ = self.engine
        place = FaultLocation(
            path="toycar/sensing.py",
            function=function,
            anchor=Anchor(kind=AnchorKind.AFTER_ASSIGN, name=anchor),
        )
        injection = Injection(location=place, model="offset", params=(("by", 20.0), ("target", anchor)))
        fault = Fault("s", "m", "f", "as_described", None, "", "H1", (injection,))
        built = mutant.build(self.manifest, self.models, fault, trigger)
        scenario = self.toy.scenario("A")
        return Job(
            name="j", scenario=scenario, seed=7, files=built.files, mutant=built.id, golden=self.golden
        )

    def run(self, job: Job) -> Execution:
        folder = self.folder / "work" / "job"
        try:
            return self.engine.execute(job, folder)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    @property
    def pool(self) -> Pool:
        pool = self.engine._pool
        assert pool is not None
        return pool

    def processes(self) -> list[int]:
        """Process ids of the server and all that came of it."""
        return sorted(int(path.name) for path in Path("/proc").glob("[0-9]*") if self._is_ours(path))

    def _is_ours(self, path: Path) -> bool:
        try:
            return str(self.folder).encode() in (path / "cmdline").read_bytes()
        except OSError:
            return False

    def close(self) -> None:
        if self._engine is not None:
            self._engine.close()


@pytest.fixture
def fork(toycar: Workspace, tmp_path: Path) -> Iterator[Fork]:
    made = Fork(toycar, tmp_path)
    yield made
    made.close()


@pytest.fixture
def edit(toycar: Workspace) -> Edit:
    """Replaces text in a file of the toy."""

    def replaced(name: str, old: str, new: str) -> None:
        path = toycar.library.parent / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return replaced


def gone(pid: int) -> bool:
    """Whether the process is gone within some seconds."""
    deadline = time.monotonic() + 20.0
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except (FileNotFoundError, ProcessLookupError):
            return True
        if state == "Z":
            return True
        time.sleep(0.05)
    return False


def test_processes_have_one_thread_and_end_with_the_engine(fork: Fork) -> None:
    """Every process that forks has one OS thread; when the engine is closed, none is left, and no scratch."""
    for time_s in (2.0, 4.0, 3.0):
        assert fork.run(fork.job(at_time(time_s))).how is How.FORK
    pids = fork.processes()
    assert len(pids) >= 3, "the server, a golden run at its start, and some further on"
    for pid in pids:
        status = Path(f"/proc/{pid}/status").read_text()
        assert "\nThreads:\t1\n" in status
    fork.close()
    assert all(map(gone, pids))
    assert [path.name for path in (fork.folder / "work").iterdir() if "server" in path.name] == []


def test_a_fork_starts_right_before_its_fault(fork: Fork) -> None:
    """The golden run drives the steps before the activation, and the waiting processes are few."""
    starts = [fork.run(fork.job(at_time(0.05 * step))).start for step in (40, 41, 90, 10, 100, 0)]
    assert starts == [40, 41, 90, 10, 100, 0]
    for step in range(3, 100, 9):
        fork.run(fork.job(at_time(0.05 * step)))
    assert len(fork.processes()) <= 10


def test_a_never_active_fault_is_not_run(fork: Fork) -> None:
    """An experiment whose trigger never holds has golden's files as its own, and costs nothing."""
    execution = fork.run(fork.job(at_time(100.0)))
    assert (execution.how, execution.status, execution.cpu_s) == (How.GOLDEN, Status.OK, 0.0)
    assert execution.out == fork.golden


def test_a_kill_is_a_harness_error_and_the_next_run_goes_on(fork: Fork) -> None:
    """Killing server or waiting processes is told as the harness's failure; the next job has new ones."""
    job = fork.job(at_time(2.0))
    for place in (0, -1):  # the first process, and one that waits
        assert fork.run(job).status is Status.OK
        victims = fork.processes()
        os.kill(victims[place], signal.SIGKILL)
        assert gone(victims[place])
        time.sleep(0.1)
        execution = fork.run(job)
        if execution.status is Status.OK:  # a process that waits had been left in peace
            assert place == 0
            execution = fork.run(fork.job(Trigger(name="x", condition="t >= 0.01")))
        assert execution.status is Status.HARNESS_ERROR
        assert "fork server" in execution.detail
        assert fork.run(job).status is Status.OK
        assert all(map(gone, victims)), "nothing is left of the server that was killed"


@pytest.mark.slow
def test_waiting_processes_end_with_the_server(fork: Fork) -> None:
    """All that waits ends when the first process is killed."""
    fork.run(fork.job(at_time(2.0)))
    first, *waiting = fork.processes()
    assert first == fork.pool._process.pid
    assert waiting
    os.kill(first, signal.SIGKILL)
    assert all(map(gone, waiting))


ENGINE = """
import sys, time
from pathlib import Path
from mutator.workspace import Workspace
sys.path.insert(0, sys.argv[4])
from test_fork_engine import Fork, at_time
toy = Workspace(library=Path(sys.argv[1]), templates=Path(sys.argv[2]))
fork = Fork(toy, Path(sys.argv[3]))
print(fork.run(fork.job(at_time(2.0))).how, flush=True)
time.sleep(60)
"""


@pytest.mark.slow
def test_the_server_ends_with_its_engine(toycar: Workspace, tmp_path: Path) -> None:
    """Killing the process of the engine ends the server and all that waits."""
    arguments = [toycar.library, toycar.templates, tmp_path, Path(__file__).parent]
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
    assert all(map(gone, pids))


def test_a_target_with_threads_is_not_forked(fork: Fork, edit: Edit) -> None:
    """A target that starts a thread when it is loaded is run by the reference engine, and told why."""
    edit(
        "tree/toycar/go.py",
        "class Drive:",
        "import threading\nthreading.Thread(target=threading.Event().wait, daemon=True).start()\n"
        "class Drive:",
    )
    execution = fork.run(fork.job(at_time(2.0)))
    assert (execution.how, execution.status) == (How.REFERENCE, Status.OK)
    assert "2 threads" in execution.why


def test_a_target_that_cannot_be_loaded(fork: Fork, edit: Edit) -> None:
    """A target that cannot be imported outside its command is run by the reference engine, and told why."""
    edit(
        "tree/toycar/go.py",
        "class Drive:",
        "if __name__ != '__main__':\n    raise ValueError(3)\n\n\nclass Drive:",
    )
    execution = fork.run(fork.job(at_time(2.0)))
    assert (execution.how, execution.status) == (How.REFERENCE, Status.OK)
    assert "cannot be loaded: ValueError: 3 (toycar/go.py:" in execution.why


@pytest.mark.slow
def test_a_target_that_is_another_one_step_by_step(fork: Fork, edit: Edit) -> None:
    """A stepwise golden run with other bytes than the command's disqualifies the engine for it."""
    edit(
        "tree/toycar/go.py",
        "    drive = begin(arguments)\n",
        "    drive = begin(arguments)\n    drive.steps -= 1\n",
    )
    execution = fork.run(fork.job(at_time(2.0)))
    assert execution.how is How.REFERENCE
    assert "log.npz is another one" in execution.why


@pytest.mark.slow
def test_a_target_that_leaves_threads(fork: Fork, edit: Edit) -> None:
    """A run that leaves a thread behind would not have ended by itself: the reference engine says so."""
    fork.limits = replace(LIMITS, wall_s=3)
    edit(
        "tree/toycar/sensing.py",
        "        self.publish((gap",
        "        if gap > 45.0:\n            import threading, time\n"
        "            threading.Thread(target=time.sleep, args=(100,)).start()\n        self.publish((gap",
    )
    execution = fork.run(fork.job(at_time(5.9)))
    assert (execution.status, execution.how) == (Status.TIMEOUT, How.REFERENCE)
    assert execution.why == "it leaves threads behind"


@pytest.mark.slow
def test_a_target_that_writes_into_its_tree(fork: Fork, edit: Edit) -> None:
    """A run that writes into its tree does not reach the next one, and the reference engine judges it."""
    edit(
        "tree/toycar/sensing.py",
        "        self.publish((gap",
        "        if gap > 45.0:\n            open(__file__, 'a').write('x')\n        self.publish((gap",
    )
    execution = fork.run(fork.job(at_time(5.9)))
    assert (execution.status, execution.how) == (Status.HARNESS_ERROR, How.REFERENCE)
    assert execution.why == "it writes into its own tree"
    assert "toycar/sensing.py in the tree that ran" in execution.detail


def test_what_cannot_be_exchanged_is_told(fork: Fork, edit: Edit) -> None:
    """A fault in a function that is suspended between steps is run by the reference engine, and told why."""
    edit(
        "tree/toycar/sensing.py",
        "    def publish(self",
        "    def walk(self):\n        gap = 0.0\n        yield gap\n\n    def publish(self",
    )
    execution = fork.run(fork.job(at_time(2.0), function="Sensor.walk"))
    assert (execution.status, execution.how) == (Status.OK, How.REFERENCE)
    assert execution.why == "Sensor.walk in toycar/sensing.py may be suspended between two steps"


@pytest.mark.slow
def test_the_cpu_limit_is_a_childs_own(fork: Fork, edit: Edit) -> None:
    """A child's limit of CPU time counts from its fork, not what the processes before it took."""
    edit(
        "tree/toycar/world.py",
        "        now = self.frame",
        "        sum(range(1_500_000))\n        now = self.frame",
    )
    assert fork.run(fork.job(at_time(5.5))).how is How.FORK
    fork.pool.close()
    fork.engine._pool, fork.engine._limits = None, replace(LIMITS, cpu_s=1)
    execution = fork.run(fork.job(at_time(5.5)))
    assert (execution.how, execution.status) == (How.FORK, Status.OK)
    execution = fork.run(fork.job(at_time(0.5)))
    assert (execution.how, execution.status) == (How.FORK, Status.TIMEOUT)
    assert execution.detail == "CPU time limit of 1 s"


@pytest.mark.slow
def test_a_golden_run_that_does_not_end_well(fork: Fork, edit: Edit) -> None:
    """Where the stepwise golden run breaks down, the reference engine runs, and it is told why."""
    edit(
        "tree/toycar/go.py",
        "    return Drive(case)",
        "    return Drive(case if __name__ == '__main__' else {})",
    )
    execution = fork.run(fork.job(at_time(2.0)))
    assert (execution.how, execution.status) == (How.REFERENCE, Status.OK)
    assert execution.why.startswith("its golden run cannot be driven step by step: KeyError: ")
