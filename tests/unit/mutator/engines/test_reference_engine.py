"""The reference engine: isolation, limits, and the status of each kind of ending."""

import json
import os
import resource
import shutil
import signal
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

import pytest

from mutator.engines import pyc_files
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import DiskFull, MutatorError
from mutator.limits import Limits
from mutator.model import Status
from mutator.targets.manifest import TargetManifest
from mutator.workspace import Workspace

from .ended_processes import ended

LIMITS = Limits(cpu_s=20, wall_s=60, memory_mb=1024, steps=500)
Run = Callable[..., JobResult]


@pytest.fixture
def manifest(toycar: Workspace) -> TargetManifest:
    return toycar.manifest("toycar")


@pytest.fixture
def run(toycar: Workspace, manifest: TargetManifest, tmp_path: Path) -> Run:
    work = tmp_path / "work"
    work.mkdir()

    def execute(files: Mapping[str, str] | None = None, limits: Limits = LIMITS, **job: object) -> JobResult:
        engine = ReferenceEngine(manifest, work, limits)
        changed = {name: text.encode() for name, text in (files or {}).items()}
        wanted = Job(name="job", scenario=toycar.scenario("A"), seed=1, changed_files=changed, **job)  # type: ignore[arg-type]
        shutil.rmtree(work / "job", ignore_errors=True)
        return engine.execute(wanted, work / "job")

    return execute


def entry(body: str) -> dict[str, str]:
    return {"toycar/go.py": body}


def test_a_mutant_of_a_file_that_runs_read_uses_no_shared_caches(
    toycar: Workspace, manifest: TargetManifest, tmp_path: Path
) -> None:
    said = 'import json, sys\nfrom pathlib import Path\nPath("words.json").write_text(json.dumps(sys.argv))\n'
    changed = replace(manifest, independent_args=("--forget",), globs_read_by_runs=("toycar/sens*.py",))
    engine = ReferenceEngine(changed, tmp_path, LIMITS)
    for read in ("toycar/sensing.py", "toycar/driver.py"):
        files = {"toycar/go.py": said.encode(), read: b""}
        job = Job(name="job", scenario=toycar.scenario("A"), seed=1, changed_files=files)
        execution = engine.execute(job, tmp_path / Path(read).stem)
        words = json.loads((execution.out / "words.json").read_text())
        assert ("--forget" in words) is (read == "toycar/sensing.py")


def test_a_successful_run_leaves_its_trace_and_record(run: Run) -> None:
    execution = run()
    assert (execution.status, execution.detail) == (Status.OK, "")
    assert {path.name for path in execution.out.iterdir()} == {"log.npz", "said.json"}
    assert 0.0 < execution.cpu_s < 20.0
    assert execution.probe_report is None


@pytest.mark.parametrize(
    ("body", "status", "detail"),
    [
        ("raise ValueError('no')", Status.CRASHED, "ValueError: no (toycar/go.py:1)"),
        ("raise ValueError", Status.CRASHED, "ValueError (toycar/go.py:1)"),
        ("import sys; sys.exit(3)", Status.CRASHED, "exit status 3 (toycar/go.py:1)"),
        ("raise SystemExit", Status.OK, ""),
        ("raise KeyboardInterrupt", Status.CRASHED, "KeyboardInterrupt (toycar/go.py:1)"),
        (
            "raise ValueError(object())",
            Status.CRASHED,
            "ValueError: <object object at 0x...> (toycar/go.py:1)",
        ),
        (r"raise ValueError('\udc80 \n')", Status.CRASHED, r"ValueError: \udc80 \n (toycar/go.py:1)"),
        ("import os; os._exit(0)", Status.CRASHED, "left with status 0 without a report"),
        ("import ctypes; ctypes.string_at(0)", Status.CRASHED, "killed by SIGSEGV"),
        ("import os; os.abort()", Status.CRASHED, "killed by SIGABRT"),
        ("x = bytearray(1 << 40)", Status.CRASHED, "MemoryError (toycar/go.py:1)"),
        ("import os; os.kill(os.getpid(), 9)", Status.HARNESS_ERROR, "killed from outside by SIGKILL"),
        ("import os; os.kill(os.getpid(), 15)", Status.HARNESS_ERROR, "killed from outside by SIGTERM"),
    ],
)
def test_each_kind_of_ending_has_its_status(run: Run, body: str, status: Status, detail: str) -> None:
    execution = run(entry(body))
    assert (execution.status, execution.detail) == (status, detail)


def test_a_syntax_error_in_executed_code_is_a_crash(run: Run) -> None:
    execution = run(entry("if :"))
    assert execution.status is Status.CRASHED
    assert "go.py" in execution.detail


def test_an_endless_loop_hits_the_cpu_limit(run: Run) -> None:
    execution = run(entry("while True: pass"), replace(LIMITS, cpu_s=1))
    assert (execution.status, execution.detail) == (Status.TIMEOUT, "CPU time limit of 1 s")


def test_a_run_that_ignores_the_cpu_limit_is_killed(run: Run) -> None:
    body = "import signal; signal.signal(signal.SIGXCPU, signal.SIG_IGN)\nwhile True: pass"
    execution = run(entry(body), replace(LIMITS, cpu_s=1))
    assert (execution.status, execution.detail) == (Status.TIMEOUT, "CPU time limit of 1 s")


def test_sleeping_hits_the_wall_limit(run: Run) -> None:
    execution = run(entry("import time; time.sleep(100)"), replace(LIMITS, wall_s=1))
    assert (execution.status, execution.detail) == (Status.TIMEOUT, "wall time limit of 1 s")


def test_a_run_kept_alive_by_a_thread_times_out(run: Run) -> None:
    body = "import threading, time; threading.Thread(target=time.sleep, args=(100,)).start()"
    execution = run(entry(body), replace(LIMITS, wall_s=2))
    assert (execution.status, execution.detail) == (Status.TIMEOUT, "wall time limit of 2 s")


def test_a_run_with_too_many_steps_times_out(run: Run) -> None:
    probe = (
        "MUTANT = 'm'\nclass StepLimit(RuntimeError): pass\n"
        "def limit(n): global most; most = n\n"
        "def active(fi): return False\n"
        "def report(): return {'mutant': MUTANT, 'triggered': None, 'injections': {}}\n"
        "def observe(n):\n    if n > most: raise StepLimit\n"
    )
    body = "from toycar import _fi\nfor n in range(1000): _fi.observe(n)"
    files = {"toycar/_fi.py": probe, **entry(body)}
    execution = run(files, replace(LIMITS, steps=100), mutant_id="m")
    assert (execution.status, execution.detail) == (Status.TIMEOUT, "limit of 100 simulation steps")
    assert run(files, replace(LIMITS, steps=2000), mutant_id="m").status is Status.OK
    other = run(files, replace(LIMITS, steps=2000), mutant_id="another")
    assert other.status is Status.HARNESS_ERROR
    assert "not the one of this mutant" in other.detail


def test_a_run_that_writes_a_huge_file_crashes(run: Run) -> None:
    body = "f = open('x', 'wb')\nf.seek(1 << 40)\nf.write(b'x')\nf.flush()"
    execution = run(entry(body))
    assert execution.status is Status.CRASHED
    assert "File too large" in execution.detail


def test_importing_the_package_from_outside_the_tree_is_a_harness_error(
    run: Run, manifest: TargetManifest
) -> None:
    body = (
        f"import sys; sys.path.insert(0, {str(manifest.root)!r})\n"
        "for name in [n for n in sys.modules if n.startswith('toycar')]: del sys.modules[name]\n"
        "import toycar.world\n"
    )
    execution = run(entry(body))
    assert execution.status is Status.HARNESS_ERROR
    assert "imported from" in execution.detail


def test_changing_the_tree_during_a_run_is_a_harness_error(run: Run) -> None:
    body = "import toycar.world, pathlib\npathlib.Path(toycar.world.__file__).write_text('STEP = 1')"
    execution = run(entry(body))
    assert execution.status is Status.HARNESS_ERROR
    assert "toycar/world.py" in execution.detail
    assert run().status is Status.OK, "the next run must have an intact tree"


@pytest.mark.parametrize("edit", ["os.truncate(code, 20)", "os.unlink(code)", "open(code, 'ab').write(b'x')"])
def test_a_run_that_changes_its_bytecode_is_repeated_without_any(run: Run, edit: str) -> None:
    """Nothing tells it from a run that used the bytecode of somebody else."""
    body = f"import toycar.world, os\ncode = toycar.world.__cached__\nprint(os.path.exists(code))\n{edit}"
    execution = run(entry(body))
    assert (execution.status, execution.log_tail.split("\n")[0]) == (Status.CRASHED, "False")
    execution = run(entry(body.replace(edit, f"if os.path.exists(code): {edit}")))
    assert (execution.status, execution.log_tail) == (Status.OK, "False\n")
    assert run().status is Status.OK


def test_a_replaced_log_or_report_is_treated_as_missing(run: Run) -> None:
    head = "import os\nos.unlink('../log')\n"
    for body in ("", "os.mkdir('../log')", "os.mkfifo('../log')"):
        execution = run(entry(head + body))
        assert (execution.status, execution.log_tail) == (Status.OK, "")
    for body in ("os.mkfifo", "os.mkdir", "os.symlink('/dev/zero', '../report.json') or str"):
        execution = run(entry(f"import os\n{body}('../report.json')\nos._exit(0)"))
        assert (execution.status, execution.detail) == (Status.CRASHED, "left with status 0 without a report")


@pytest.mark.parametrize(
    "more",
    [
        {"files": 5, "modules": []},
        {"files": {}, "modules": [5]},
        {"files": {}, "modules": [], "outside": [5]},
        {"files": {}, "modules": [], "error": {"kind": "x", "message": "", "stacks": []}},
        {},
    ],
)
def test_an_invalid_report_is_rejected(run: Run, more: dict[str, object]) -> None:
    report = {"ended": "ok", "error": None, "disk_full": False, "outside": [], "probe": None, **more}
    body = f"import json, os\nopen('../report.json', 'w').write(json.dumps({report!r}))\nos._exit(0)"
    execution = run(entry(body))
    assert (execution.status, execution.detail) == (Status.CRASHED, "left with status 0 without a report")


def test_unprintable_names_are_stored_as_printable_text(run: Run) -> None:
    """The target chooses the names of its classes and files."""
    body = (
        "import os\nname = os.path.join(os.path.dirname(__file__), '\\udcff\\n')\n"
        "exec(compile('raise type(\"a\\\\n\", (Exception,), {})', name, 'exec'))"
    )
    raised = run(entry(body)).exception
    assert raised is not None
    assert (raised.kind, raised.place) == (r"a\n", r"toycar/\udcff\n:1")


def test_a_run_receives_signals_that_its_parent_ignored(run: Run) -> None:
    """Background programs ignore some signals, and their child processes inherit that."""
    body = "import os, signal\nos.kill(os.getpid(), signal.SIGINT)"
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])
    try:
        assert run(entry(body)).detail == "KeyboardInterrupt (toycar/go.py:2)"
        assert run(entry(body.replace("SIGINT", "SIGALRM"))).detail == "killed by SIGALRM"
    finally:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, [signal.SIGALRM])
        signal.signal(signal.SIGINT, before)


def test_a_source_file_that_a_run_adds_to_its_tree_is_a_harness_error(run: Run) -> None:
    body = "import toycar, pathlib\npathlib.Path(toycar.__file__).with_name('left.py').touch()"
    execution = run(entry(body))
    assert execution.status is Status.HARNESS_ERROR
    assert "toycar/left.py" in execution.detail
    assert run(entry(body.replace("left.py", "left.json"))).status is Status.OK


def test_stale_bytecode_is_not_run(run: Run, manifest: TargetManifest) -> None:
    """The changed file's size and time equal the original's."""
    pristine = manifest.tree.files["toycar/world.py"].decode()
    changed = pristine.replace("STEP = 0.05", "STEP = 0.06")
    body = "from toycar.world import STEP\nraise ValueError(STEP)"
    execution = run({"toycar/world.py": changed, **entry(body)})
    assert execution.detail.startswith("ValueError: 0.06")
    cached = pyc_files.files_with_bytecode(manifest.tree, manifest.entry_module)[
        pyc_files.bytecode_path("toycar/world.py")
    ]
    assert int.from_bytes(cached[4:8], "little") == 0b11, "expected a check by hash"


def test_the_users_environment_does_not_reach_a_run(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/nowhere")
    monkeypatch.setenv("MUTATOR_SECRET", "x")
    body = (
        "import os, sys\n"
        "assert 'MUTATOR_SECRET' not in os.environ and '/nowhere' not in sys.path\n"
        "raise ValueError(os.environ['PYTHONHASHSEED'], os.environ['OMP_NUM_THREADS'])"
    )
    assert run(entry(body), hash_seed=42).detail.startswith("ValueError: ('42', '1')")


def test_the_output_of_a_run_is_kept(run: Run) -> None:
    assert "hello" in run(entry("print('hello')")).log_tail


def test_grandchildren_end_with_the_run(run: Run, tmp_path: Path) -> None:
    note = tmp_path / "pid"
    body = (
        "import subprocess, pathlib\n"
        f"pathlib.Path({str(note)!r}).write_text(str(subprocess.Popen(['sleep', '60']).pid))"
    )
    assert run(entry(body)).status is Status.OK
    assert ended(int(note.read_text()))


def test_a_full_disk_is_not_a_crash(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DiskFull):
        run(entry("import errno; raise OSError(errno.ENOSPC, 'No space left on device')"))
    real = os.statvfs

    def full(path: object) -> os.statvfs_result:
        fields = list(real(path))  # type: ignore[call-overload]
        fields[4] = 0
        return os.statvfs_result(fields)

    monkeypatch.setattr(os, "statvfs", full)
    with pytest.raises(DiskFull):
        run(entry("raise SystemExit('cannot write')"))
    assert run().status is Status.OK


def test_jobs_run_in_order_and_their_folders_are_deleted(
    toycar: Workspace, manifest: TargetManifest, tmp_path: Path
) -> None:
    work = tmp_path / "work"
    work.mkdir()
    engine = ReferenceEngine(manifest, work, LIMITS)
    jobs = [Job(name=name, scenario=toycar.scenario(name), seed=1) for name in ("A", "B")]
    names = []
    for job, execution in engine.run(jobs):
        assert (execution.out / "said.json").is_file()
        names.append(job.name)
    engine.close()
    assert names == ["A", "B"]
    assert list(work.iterdir()) == []


def test_two_threads_can_use_one_engine(
    run: Run, toycar: Workspace, manifest: TargetManifest, tmp_path: Path
) -> None:
    work = tmp_path / "side"
    work.mkdir()
    engine = ReferenceEngine(manifest, work, LIMITS)
    found: list[Status] = []

    def one(name: str) -> None:
        job = Job(name=name, scenario=toycar.scenario("A"), seed=1)
        found.append(engine.execute(job, work / name).status)

    threads = [threading.Thread(target=one, args=(name,)) for name in ("x", "y")]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [Status.OK, Status.OK]


def test_the_report_lists_only_packages_that_the_run_imports(run: Run) -> None:
    assert run().third_party_modules == ()
    assert run(entry("import numpy")).third_party_modules == ("numpy",)
    assert run(entry("import json, iniconfig.exceptions, toycar.world")).third_party_modules == ("iniconfig",)


def test_the_report_leaves_out_modules_of_python_and_those_without_a_file(run: Run) -> None:
    """Numpy's extensions make some, and Python's configuration has another name on each system."""
    code = (
        "import numpy.random, sys, sysconfig, types\nsysconfig.get_config_vars()\nsys.modules['made'] = types"
    )
    code += ".ModuleType('made'); sys.modules['strange'] = 1"
    assert run(entry(code)).third_party_modules == ("numpy",)


def test_the_report_lists_packages_with_loaded_shared_libraries(run: Run) -> None:
    """The versions of these packages affect results, although the run does not import them."""
    code = (
        "import ctypes; from importlib.util import find_spec; from pathlib import Path\n"
        "ctypes.CDLL(str(Path(find_spec('casadi').origin).with_name('libdaqp.so')))"
    )
    assert run(entry(code)).third_party_modules == ("casadi",)


@pytest.mark.parametrize(("limit", "name"), [("AS", "memory_mb"), ("CPU", "cpu_s"), ("FSIZE", "disk_mb")])
def test_resource_limits_below_those_of_the_campaign_are_refused(
    manifest: TargetManifest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, limit: str, name: str
) -> None:
    """Otherwise, runs would end differently than on other machines."""
    number, unlimited = getattr(resource, f"RLIMIT_{limit}"), (resource.RLIM_INFINITY, resource.RLIM_INFINITY)
    monkeypatch.setattr(resource, "getrlimit", lambda which: (1, 1) if which == number else unlimited)

    def refuse(which: int, limits: tuple[int, int]) -> None:
        raise ValueError("not allowed to raise maximum limit")

    monkeypatch.setattr(resource, "setrlimit", refuse)
    with pytest.raises(MutatorError, match=rf"the limit is 1 here \(`ulimit -.`\).*{name}.*raise the limit"):
        ReferenceEngine(manifest, tmp_path, LIMITS)
