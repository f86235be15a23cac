"""In a sandbox, a target's code reaches nothing but what its run needs, and computes the same."""

import json
import os
import socket
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from mutator._common.files import remove_folder
from mutator.engines import sandbox
from mutator.engines.engine_jobs import Job, JobResult, RunMode
from mutator.engines.reference_engine import ReferenceEngine
from mutator.engines.sandbox import Sandbox
from mutator.errors import EXIT_WRONG_INPUT, MutatorError
from mutator.limits import Limits
from mutator.model import Status
from mutator.triggers.trigger_kinds import trigger_at_time
from mutator.workspace import Workspace

from ..fork_on_toy import Edit, Fork

LIMITS = Limits(cpu_s=2, wall_s=60, memory_mb=1024, steps=500, disk_mb=8)
Run = Callable[..., JobResult]
needed = pytest.mark.skipif(
    bool(sandbox.reason_sandbox_unavailable()), reason=f"no sandbox: {sandbox.reason_sandbox_unavailable()}"
)

REACHING = """
import json, os, socket
from pathlib import Path

def refused(act):
    try:
        return repr(act())
    except OSError as err:
        return type(err).__name__

def connect():
    return socket.create_connection(("127.0.0.1", {port}), timeout=5)

def write(path):
    return Path(path).write_text("changed")

found = {{
    "secret": refused(Path("{home}/.ssh/id").read_bytes),
    "kill": refused(lambda: os.kill({pid}, 0)),
    "connect": refused(connect),
    "home": refused(lambda: write("{home}/new")),
    "scenario": refused(lambda: write("{scenario}")),
    "library": refused(lambda: os.listdir("{library}/faults")),
    "beside": refused(lambda: write("../../beside")) and None,  # a folder of the sandbox
    "system": refused(lambda: write("/etc/new")),
    "devices": refused(lambda: write("/dev/new")),
    "host": refused(lambda: os.listdir("/root/.cache")),
    "processes": sorted(int(name) for name in os.listdir("/proc") if name.isdigit()),
}}
write("/tmp/{mark}")
write("/dev/shm/{mark}")
write("written.json") and write(os.environ["TMPDIR"] + "/mine")
Path("found.json").write_text(json.dumps(found))
"""


@pytest.fixture
def run(toycar: Workspace, tmp_path: Path) -> Iterator[Run]:
    manifest = replace(toycar.manifest("toycar"), sandbox=True)
    (tmp_path / "work").mkdir()
    engine = ReferenceEngine(manifest, tmp_path / "work", LIMITS)

    def execute(body: str | None = None) -> JobResult:
        files = {} if body is None else {"toycar/go.py": body.encode()}
        job = Job(name="job", scenario=toycar.scenario("A"), seed=1, changed_files=files)
        remove_folder(tmp_path / "work/job")
        return engine.execute(job, tmp_path / "work/job")

    yield execute
    engine.close()


@needed
def test_a_run_reaches_nothing_outside(
    run: Run, toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, mark = tmp_path / "home", f"mutator-left-{os.getpid()}"
    (home / ".ssh").mkdir(parents=True)
    (home / ".ssh/id").write_text("secret")
    monkeypatch.setenv("HOME", str(home))
    scenario = toycar.scenario("A")
    before = scenario.read_bytes()
    with socket.create_server(("127.0.0.1", 0)) as server:
        places = {"home": home, "scenario": scenario, "library": toycar.library, "mark": mark}
        execution = run(REACHING.format(port=server.getsockname()[1], pid=os.getpid(), **places))
    assert (execution.status, execution.detail) == (Status.OK, "")
    found = json.loads((execution.out / "found.json").read_text())
    assert found.pop("processes") == [1, 2], "the guard and the run"
    assert not (tmp_path / "work/beside").exists()
    assert found == {
        "beside": None,
        "secret": "FileNotFoundError",
        "kill": "ProcessLookupError",
        "connect": "ConnectionRefusedError",
        "home": "FileNotFoundError",
        "scenario": "OSError",
        "library": "FileNotFoundError",
        "system": "OSError",
        "devices": "OSError",
        "host": "FileNotFoundError",
    }
    assert scenario.read_bytes() == before and (execution.out / "written.json").exists()
    assert not Path("/tmp", mark).exists() and not Path("/dev/shm", mark).exists()


@needed
@pytest.mark.parametrize(
    ("body", "status", "detail"),
    [
        ("raise ValueError('no')", Status.CRASHED, "ValueError: no (toycar/go.py:1)"),
        ("import os; os._exit(0)", Status.CRASHED, "left with status 0 without a report"),
        ("import ctypes; ctypes.string_at(0)", Status.CRASHED, "killed by SIGSEGV"),
        ("import os; os.kill(os.getpid(), 9)", Status.HARNESS_ERROR, "killed from outside by SIGKILL"),
        ("import os; os.kill(os.getppid(), 9)", Status.OK, ""),  # nothing inside can kill the guard
        ("import os; os.kill(-1, 9)", Status.CRASHED, "ProcessLookupError"),  # there is no other
        ("import os\nif not os.fork():\n    os.setsid(); import time; time.sleep(60)", Status.OK, ""),
        ("while True: pass", Status.TIMEOUT, "CPU time limit of 2 s"),
        ("open('/dev/shm/x', 'wb').write(bytes(9 << 20))", Status.TIMEOUT, "disk limit"),
        ("for i in range(9): open(f'/tmp/{i}', 'wb').write(bytes(1 << 20))", Status.TIMEOUT, "disk limit"),
    ],
)
def test_each_kind_of_ending_has_its_status(run: Run, body: str, status: Status, detail: str) -> None:
    execution = run(body)
    assert execution.status is status and execution.detail.startswith(detail), execution.detail


@needed
def test_runs_leave_the_bytes_of_runs_without_a_sandbox(run: Run, toycar: Workspace, tmp_path: Path) -> None:
    (tmp_path / "open").mkdir()
    engine = ReferenceEngine(toycar.manifest("toycar"), tmp_path / "open", LIMITS)
    plain = engine.execute(Job(name="a", scenario=toycar.scenario("A"), seed=1), tmp_path / "open/a")
    boxed = run()
    assert (
        boxed.status is plain.status is Status.OK and boxed.third_party_modules == plain.third_party_modules
    )
    assert {path.name for path in boxed.out.iterdir()} == {"log.npz", "said.json"}
    for path in plain.out.iterdir():
        assert (boxed.out / path.name).read_bytes() == path.read_bytes()


@needed
def test_a_fork_server_and_its_mutants_share_a_sandbox(toycar: Workspace, tmp_path: Path, edit: Edit) -> None:
    """The target leaves a file in /tmp. No other run finds it."""
    leaving = '        __import__("tempfile").NamedTemporaryFile(dir="/tmp", delete=False).close()\n'
    edit(
        "tree/toycar/sensing.py",
        "        offset = world.offset\n",
        f"        offset = world.offset\n{leaving}",
    )
    boxed = Fork(replace(toycar, sandbox=True), tmp_path)
    job = boxed.job(trigger_at_time(3.0))
    [(_, first)] = boxed.engine.run([job])
    [folder] = (tmp_path / "work").glob("*-fork")
    assert [path for path in (folder / "tmp").rglob("*") if path.is_file()] == []
    [(_, second)] = boxed.engine.run([replace(job, name="k")])
    assert first.mode is second.mode is RunMode.FORK and first.status is Status.OK, first.fallback_reason
    boxed.close()
    assert not folder.exists()


def test_what_a_run_left_is_cleared_even_if_it_exchanged_folders_for_links(tmp_path: Path) -> None:
    box, mine = tmp_path / "box", tmp_path / "mine"
    for folder in (box / "tmp/mounted", mine):
        folder.mkdir(parents=True)
    (mine / "kept").write_text("x")
    found = Sandbox(box, ())
    found.note_initial_temporary_paths()
    (box / "tmp/left/inner").mkdir(parents=True)
    (box / "shm/left").write_text("x")
    (box / "tmp/link").symlink_to(mine)
    (box / "tmp").rename(box / "moved")
    (box / "tmp").symlink_to(mine)
    found.delete_new_temporary_paths()
    found.close()
    assert (mine / "kept").exists() and list((box / "shm").iterdir()) == []
    assert [path.name for path in (box / "moved").iterdir()] == ["mounted"]


@needed
def test_a_mutant_that_exchanges_its_folder_for_a_link_reaches_nothing(
    toycar: Workspace, tmp_path: Path, edit: Edit
) -> None:
    """The harness neither follows the link nor runs the mutant again in the folder behind it."""
    mine = tmp_path / "mine"
    (mine / "out").mkdir(parents=True)
    (mine / "out" / "tool").symlink_to("/usr/bin/env")
    (mine / "kept").write_text("x")
    body = (
        "        here = __import__('os').path.dirname(__import__('os').getcwd())\n"
        "        if here.endswith('/mutant'):\n"
        "            __import__('os').rename(here, here + '-x')\n"
        f"            __import__('os').symlink({str(mine)!r}, here)\n"
        "            raise ValueError('run me again')\n"
    )
    edit(
        "tree/toycar/sensing.py", "        offset = world.offset\n", f"        offset = world.offset\n{body}"
    )
    boxed = Fork(replace(toycar, sandbox=True), tmp_path)
    job = replace(boxed.job(trigger_at_time(3.0)), name="mutant")
    [(_, execution)] = boxed.engine.run([job])
    boxed.close()
    assert (execution.status, execution.mode) == (Status.OK, RunMode.REFERENCE), "it runs again elsewhere"
    assert execution.fallback_reason == "it moves its folder"
    assert sorted(path.name for path in mine.rglob("*")) == ["kept", "out", "tool"]


@needed
def test_only_fault_free_runs_write_to_a_cache_of_this_target_alone(run: Run, toycar: Workspace) -> None:
    manifest = toycar.manifest("toycar")
    cache = replace(manifest, sandbox=True).cache_folder
    assert cache.parent == manifest.cache_folder.parent and cache != manifest.cache_folder
    body = f"open({str(cache / 'frame')!r}, 'w').write('x')"
    assert run(body).detail.startswith("FileNotFoundError")
    assert run().status is Status.OK and list(cache.iterdir()) == []
    execution = run(body)
    assert (execution.status, execution.detail[:19]) == (Status.CRASHED, "OSError: [Errno 30]")


@needed
def test_the_harness_follows_no_link_that_a_run_left(run: Run, tmp_path: Path) -> None:
    (tmp_path / "mine").write_text("secret words")
    body = f"import os\nos.remove('../log')\nos.symlink({str(tmp_path / 'mine')!r}, '../log')"
    assert "secret" not in run(body).log_tail


@pytest.fixture
def no_bwrap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder on PATH without `bwrap`."""
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    sandbox.reason_sandbox_unavailable.cache_clear()
    yield tmp_path / "bin"
    sandbox.reason_sandbox_unavailable.cache_clear()


def test_without_bubblewrap_a_sandbox_is_refused(no_bwrap: Path, toycar: Workspace) -> None:
    with pytest.raises(MutatorError, match="sandbox: no sandbox: `bwrap` is not installed") as caught:
        Workspace.find(toycar.library.parent, sandbox=True)
    assert caught.value.exit_code == EXIT_WRONG_INPUT


def test_where_namespaces_are_refused_a_sandbox_is_refused(no_bwrap: Path, toycar: Workspace) -> None:
    (no_bwrap / "bwrap").write_text(
        "#!/bin/sh\necho 'bwrap: No permissions to create new namespace' >&2\nexit 1\n"
    )
    (no_bwrap / "bwrap").chmod(0o755)
    with pytest.raises(MutatorError, match="no sandbox: bwrap: No permissions to create new namespace"):
        Workspace.find(toycar.library.parent, sandbox=True)
