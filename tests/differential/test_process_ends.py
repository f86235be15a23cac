"""In every engine, a run's process ends in the same way and leaves the same files and no daemon."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.engines.engine_jobs import JobResult, RunMode
from mutator.engines.engine_kinds import ENGINES
from mutator.limits import Limits
from mutator.model import Status
from mutator.workspace import Workspace

from .test_engines import LIMITS, MODELS, TRIGGERS, Engines, fault

Misbehave = Callable[..., dict[str, tuple[JobResult, dict[str, bytes]]]]
RESULTS = {"log.npz", "said.json"}
MEET_TROUBLE = """        self.rows.append("""
TROUBLE = """        if self.sensor.reading[0] > 60.0:
            import toycar.trouble
        self.rows.append("""


ACTIVE = (fault(*MODELS["offset"]), TRIGGERS["from 2.01 s"])


def with_trouble(toy: Workspace, folder: Path, trouble: str, head: str, limits: Limits) -> Engines:
    """Return engines for the toy with a mutant that executes `trouble`. `head` runs when the target is
    loaded."""
    package = toy.library.parent / "tree" / "toycar"
    go = (package / "go.py").read_text()
    assert MEET_TROUBLE in go
    (package / "go.py").write_text(head + "\n" + go.replace(MEET_TROUBLE, TROUBLE))
    (package / "trouble.py").write_text(trouble)
    return Engines(toy, folder, limits)


@pytest.fixture
def misbehave(tmp_path: Path, copy_toycar: Callable[[Path], Workspace]) -> Iterator[Misbehave]:
    """Return a function that runs the mutant of `with_trouble` on each engine."""
    made: list[Engines] = []

    def run(
        trouble: str, head: str = "", limits: Limits = LIMITS
    ) -> dict[str, tuple[JobResult, dict[str, bytes]]]:
        made.append(with_trouble(copy_toycar(tmp_path), tmp_path, trouble, head, limits))
        job = made[0].job(*ACTIVE)
        return {name: made[0].run(name, job) for name in ENGINES}

    yield run
    for engines in made:
        engines.close()


DAEMONS = """
import os, signal, subprocess, sys, time
from pathlib import Path

NOTES, END = Path({notes!r}), time.monotonic() + 60

def note():
    (NOTES / str(os.getpid())).touch()

def daemon(kind):
    if os.fork():
        return
    os.setsid()
    if os.fork():
        os._exit(0)
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    note()
    while kind == "forks again and again" and time.monotonic() < END:
        time.sleep(0.002)
        if os.fork():
            os._exit(0)
        note()
    if kind == "has children":
        if not os.fork():
            os.setpgid(0, 0)
            note()
    if kind == "is a program":
        os.execvp("sleep", ["sleep", "60"])
    time.sleep(60)
    os._exit(0)

before = len(list(NOTES.iterdir()))
for kind in ["waits", "forks again and again", "has children", "is a program", "waits"] * 2:
    daemon(kind)
while len(list(NOTES.iterdir())) < before + 12:
    time.sleep(0.01)
"""


def lives(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def test_ten_daemons_end_with_the_run(misbehave: Misbehave, tmp_path: Path) -> None:
    """The daemons have separate sessions and ignore signals. Some have children, and some fork repeatedly."""
    notes = tmp_path / "notes"
    notes.mkdir()
    told = misbehave(DAEMONS.format(notes=str(notes)))
    seen = [int(path.name) for path in notes.iterdir()]
    assert len(seen) > 3 * 12, "the forking daemons did not fork often enough"
    assert [pid for pid in seen if lives(pid)] == []
    time.sleep(0.1)
    assert len(list(notes.iterdir())) == len(seen), "a daemon left a note after the run"
    assert [(e.status, e.mode) for e, _ in told.values()] == [(Status.OK, RunMode(name)) for name in ENGINES]


STOPS = """
import os, signal
from pathlib import Path
pid = os.getppid()
while pid != {engine}:
    os.kill(pid, signal.SIGSTOP)
    pid = int(Path(f"/proc/{{pid}}/stat").read_text().rpartition(")")[2].split()[1])
"""


def test_processes_that_a_run_stops_go_on(misbehave: Misbehave) -> None:
    """They are those between the run and its engine: the guard, or the processes of the fork server."""
    began = time.monotonic()
    ends = misbehave(STOPS.format(engine=os.getpid()))
    assert [(e.status, e.mode) for e, _ in ends.values()] == [(Status.OK, RunMode(name)) for name in ENGINES]
    assert time.monotonic() - began < 30.0, "the runs were stopped until their limits"


def test_temporary_files_are_in_the_folder_of_the_run(misbehave: Misbehave) -> None:
    """Its size is limited. `tempfile` remembers the folder that it chose when the target was loaded."""
    trouble = "import os, tempfile\nassert os.path.samefile(tempfile.mkdtemp() + '/..', '..')"
    ends = misbehave(trouble, head="import tempfile\ntempfile.gettempdir()")
    assert [(e.status, e.mode) for e, _ in ends.values()] == [(Status.OK, RunMode(name)) for name in ENGINES]


@pytest.mark.parametrize("name", ENGINES)
def test_daemons_end_with_a_killed_engine(
    tmp_path: Path, copy_toycar: Callable[[Path], Workspace], name: str
) -> None:
    notes = tmp_path / "notes"
    notes.mkdir()
    trouble = DAEMONS.format(notes=str(notes)) + "\n(NOTES.parent / 'all').touch()\ntime.sleep(60)\n"
    pid = os.fork()
    if not pid:
        try:
            engines = with_trouble(copy_toycar(tmp_path), tmp_path, trouble, "", LIMITS)
            engines.run(name, engines.job(*ACTIVE))
        finally:
            os._exit(1)
    deadline = time.monotonic() + 60.0
    while not (tmp_path / "all").exists():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    deadline = time.monotonic() + 10.0
    while any(lives(int(path.name)) for path in notes.iterdir()):
        assert time.monotonic() < deadline


LATE_WORDS = """
import atexit, logging, logging.handlers, tempfile, weakref
from pathlib import Path

def say(word):
    with Path("late.txt").open("a") as file:
        file.write(word + "\\n")

class Thing:
    pass

thing = Thing()
weakref.finalize(thing, say, "finalized")
atexit.register(say, "first registered")
atexit.register(say, "last registered")
atexit.register(lambda: 1 / 0)
held = Path("held.txt").open("w")
held.write("x" * 100)
kept = logging.handlers.MemoryHandler(1000, target=logging.FileHandler("log.txt"))
logging.getLogger("toycar").addHandler(kept)
logging.getLogger("toycar").warning("kept until the end")
scratch = tempfile.TemporaryDirectory(dir=".")
"""


def test_exit_handlers_leave_the_same_bytes(misbehave: Misbehave) -> None:
    told = misbehave(LATE_WORDS)
    expected = {
        "late.txt": b"last registered\nfirst registered\nfinalized\n",
        "held.txt": b"x" * 100,
        "log.txt": b"kept until the end\n",
    }
    _, reference = told["reference"]
    assert {name: data for name, data in reference.items() if name not in RESULTS} == expected
    for name, (execution, files) in told.items():
        assert (execution.status, execution.mode) == (Status.OK, name)
        assert files == reference


def test_an_exit_handler_of_the_target_runs_once_per_run(misbehave: Misbehave, tmp_path: Path) -> None:
    calls = tmp_path / "calls"
    head = (
        "import atexit, os\n"
        f"atexit.register(lambda: open({str(calls)!r}, 'a').write(os.getcwd() + '\\n'))\n"
        "atexit.register(lambda: open('end.txt', 'w').write('the end'))"
    )
    told = misbehave("", head)
    assert all(files["end.txt"] == b"the end" for _, files in told.values())
    folders = [Path(line).name for line in calls.read_text().splitlines()]
    assert folders == ["out"] * 5  # the golden run, three mutants, the golden run's observations


@pytest.mark.slow
def test_an_exit_handler_that_never_returns_is_a_timeout(misbehave: Misbehave) -> None:
    waits = "import atexit, time\natexit.register(time.sleep, 100)"
    told = misbehave(waits, limits=replace(LIMITS, wall_s=2))
    assert {(e.status, e.detail) for e, _ in told.values()} == {(Status.TIMEOUT, "wall time limit of 2 s")}
    assert [e.mode for e, _ in told.values()] == list(ENGINES)


def test_a_failure_after_the_report_is_not_a_crash(misbehave: Misbehave) -> None:
    told = misbehave("import atexit, os\natexit.register(os._exit, 3)")
    assert [(e.status, e.mode) for e, _ in told.values()] == [(Status.OK, RunMode(name)) for name in ENGINES]


def test_a_run_killed_after_its_report_has_failed(misbehave: Misbehave) -> None:
    """A run that is killed so late can have incomplete files."""
    told = misbehave("import atexit, os\natexit.register(os.kill, os.getpid(), 9)")
    ends = {(e.status, e.detail) for e, _ in told.values()}
    assert ends == {(Status.HARNESS_ERROR, "killed from outside by SIGKILL")}


def test_a_thread_can_finish_after_the_run(misbehave: Misbehave) -> None:
    thread = (
        "import threading, time\nfrom pathlib import Path\nhere = Path.cwd()\n"
        "def work():\n    time.sleep(0.5)\n    (here / 'thread.txt').write_text('done')\n"
        "threading.Thread(target=work).start()"
    )
    told = misbehave(thread)
    assert {(e.status, files["thread.txt"]) for e, files in told.values()} == {(Status.OK, b"done")}


FULL = {
    "files": "for i in range(5):\n    open(f'{i}', 'wb').write(bytes(1 << 20))",
    "one file": "open('x', 'wb').write(bytes(5 << 20))",
    "one file in pieces": "f = open('x', 'wb')\nfor i in range(5): f.write(bytes(1 << 20))",
    "both folders": (
        "import tempfile\nkept = [tempfile.NamedTemporaryFile(delete=False) for i in range(2)]\n"
        "for f in (*kept, open('x', 'wb')): f.write(bytes(1 << 20)); f.flush()"
    ),
    "at the end": (
        "import atexit\ndef late():\n    for i in range(5): open(f'{i}', 'wb').write(bytes(1 << 20))\n"
        "atexit.register(late)"
    ),
    "without end": (
        "import itertools\nfor i in itertools.count():\n    open(f'{i}', 'wb').write(bytes(1 << 14))"
    ),
    "without end in folders": (
        "import itertools, os\nfor i in itertools.count():\n"
        "    os.makedirs(f'../a/{i}')\n    open(f'../a/{i}/x', 'wb').write(bytes(1 << 14))"
    ),
    "by another process": (
        "import subprocess, sys, time\nsubprocess.Popen([sys.executable, '-c', "
        "'for i in range(5): open(str(i), \"wb\").write(bytes(1 << 20))'], start_new_session=True).wait()"
    ),
}


SLOW_TO_FILL = "without end in folders"


@pytest.mark.parametrize(
    "how", [pytest.param(how, marks=pytest.mark.slow) if how == SLOW_TO_FILL else how for how in FULL]
)
def test_exceeding_the_space_limit_is_a_timeout(misbehave: Misbehave, how: str) -> None:
    told = misbehave(FULL[how], limits=replace(LIMITS, disk_mb=3))
    assert {(e.status, e.detail) for e, _ in told.values()} == {(Status.TIMEOUT, "disk limit of 3 MiB")}


def test_a_run_can_use_almost_all_its_space(misbehave: Misbehave) -> None:
    body = (
        "f = open('x', 'wb')\nf.write(bytes(2 << 20))\nf.close()\nimport os\nos.truncate('x', (3 << 20) - 1)"
    )
    told = misbehave(body, limits=replace(LIMITS, disk_mb=3))
    assert [(e.status, e.mode) for e, _ in told.values()] == [(Status.OK, RunMode(name)) for name in ENGINES]


def test_a_file_above_the_space_limit_is_a_crash(misbehave: Misbehave) -> None:
    told = misbehave("f = open('x', 'wb')\nf.seek(1 << 40)\nf.write(b'x')\nf.flush()")
    ends = {(e.status, e.detail) for e, _ in told.values()}
    assert ends == {(Status.CRASHED, "OSError: [Errno 27] File too large (toycar/trouble.py:4)")}
