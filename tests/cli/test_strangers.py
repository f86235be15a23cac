"""Commands in a folder that a stranger filled run none of its code except the target's."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from mutator.engines import sandbox
from mutator.execution.cluster import dask_connections

from .conftest import Cli

MODULES = ("json", "typing", "socket", "multiprocessing", "_pytest", "execnet", "numpy", "sitecustomize")
IDENTITY = ("-c", "user.name=x", "-c", "user.email=x@example.org", "-c", "commit.gpgsign=false")
PYTEST = "[pytest]\naddopts = --no-such-option\n"


@pytest.fixture
def hostile(root: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The library's folder as the current one, with modules and files of pytest that leave a mark."""
    for name in (*MODULES, "conftest"):
        (root / f"{name}.py").write_text(f"open({str(root / 'ran')!r}, 'a').write('{name} ')\n")
    (root / "pytest.ini").write_text(PYTEST)
    monkeypatch.chdir(root)
    return root


def test_workers_import_nothing_from_the_current_folder(cli: Cli, hostile: Path) -> None:
    answer = cli("run", "small", "--out", "run", "-n", "1", "--limit", "1", "--engine", "fork")
    assert answer.code == 0, answer.err
    assert not (hostile / "ran").exists()


@pytest.mark.slow
def test_workers_of_a_cluster_import_nothing_from_the_current_folder(cli: Cli, hostile: Path) -> None:
    answer = cli("run", "small", "--out", "run", "--cluster", "local:1", "--limit", "1")
    assert answer.code == 0, answer.err
    assert not (hostile / "ran").exists()


@pytest.mark.slow
def test_no_verb_runs_a_program_that_the_librarys_clone_names(cli: Cli, root: Path) -> None:
    ran, script, run = root.parent / "ran", root.parent / "evil", root.parent / "run"
    script.write_text(f"#!/bin/sh\necho $0 $* >> {ran}\n")
    script.chmod(0o755)
    for words in (("init", "-q"), ("add", "."), (*IDENTITY, "commit", "-qm", "all of it")):
        subprocess.run(["git", "-C", root, *words], check=True)
    (root / "more").write_text(f"[core]\n\tfsmonitor = {script}\n\thooksPath = {root}/hooks\n")
    (root / ".gitattributes").write_text("* filter=evil diff=evil\n")
    (root / "hooks").mkdir()
    for hook in ("post-index-change", "fsmonitor-watchman", "reference-transaction"):
        (root / "hooks" / hook).symlink_to(script)
    filters = ("filter.evil.clean", "filter.evil.process", "diff.evil.textconv", "diff.external")
    for name in (*filters, "gpg.program", "gpg.ssh.program", "core.pager", "core.editor"):
        subprocess.run(["git", "-C", root, "config", name, script], check=True)
    for name, value in (("include.path", root / "more"), ("log.showSignature", "true")):
        subprocess.run(["git", "-C", root, "config", name, value], check=True)
    (root / "fault_library/reviews").mkdir()
    head = 'schema: review/2\ntarget: "toycar"\nfour_eyes: true\ndecisions: []\n'
    (root / "fault_library/reviews/toycar.yaml").write_text(head)
    (root / "fault_library/faults/sensor/lane.yaml").touch()

    assert cli("run", "small", "--out", run, "-n", "0", "--limit", "2", "--no-stills").code == 0
    [experiment, *_] = (line.split(",")[0] for line in (run / "results.csv").read_text().splitlines()[1:])
    tried = ("try", "sensor/lane", "--scenario", "A", "--trigger", "1.0", "--out", root.parent / "tried")
    for words in (
        ("plan", "small", "--out", root.parent / "planned"),
        ("review", "list"),
        ("review", "approve", "--only", 'state == "new"', "--by", "Jane", "--yes"),
        ("review", "status"),
        ("diff", "sensor/lane"),
        tried,
        ("rerun", experiment, "--run", run),
        ("verify", run, "--rerun", "1"),
        ("report", run),
        ("check",),
        ("doctor",),
    ):
        answer = cli(*words)
        assert answer.code == 0, (words, answer.err)
    assert not ran.exists(), ran.read_text()


def test_processes_that_dask_starts_get_a_safe_path(monkeypatch: pytest.MonkeyPatch) -> None:
    for before in (None, "0"):
        if before is not None:
            monkeypatch.setenv("PYTHONSAFEPATH", before)
        with dask_connections.starting_processes_safely():
            assert os.environ["PYTHONSAFEPATH"] == "1"
        assert os.environ.get("PYTHONSAFEPATH") == before


@pytest.fixture
def no_bwrap(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    sandbox.reason_sandbox_unavailable.cache_clear()
    yield
    sandbox.reason_sandbox_unavailable.cache_clear()


TRY = ("try", "sensor/lane", "--scenario", "A", "--trigger", "1.0")


@pytest.mark.parametrize(
    "words",
    [("run", "small", "--out", "new", "-n", "0"), ("plan", "small", "--out", "new"), (*TRY, "--out", "new")],
)
def test_nothing_runs_where_there_is_no_sandbox(
    cli: Cli, root: Path, no_bwrap: None, words: tuple[str, ...]
) -> None:
    for command in (("--sandbox", *words), (*words, "--sandbox")):
        answer = cli(*command)
        assert answer.code == 2
        assert "--sandbox: no sandbox: `bwrap` is not installed" in answer.err and "trust.md" in answer.err
    assert not Path("new").exists()


def test_doctor_says_whether_there_is_a_sandbox(cli: Cli, root: Path, no_bwrap: None) -> None:
    [found] = [one for one in cli("doctor", "--json").json if one["name"] == "sandbox"]
    assert found["level"] == "warning" and "`bwrap` is not installed" in found["found"]


@pytest.mark.slow
@pytest.mark.skipif(
    bool(sandbox.reason_sandbox_unavailable()), reason=f"no sandbox: {sandbox.reason_sandbox_unavailable()}"
)
def test_every_way_to_run_in_a_sandbox_gives_the_results_of_one_without(cli: Cli, root: Path) -> None:
    """The target's code looks for this process. In a sandbox, it does not find it."""
    looking = f"import os\nOUTSIDE = os.path.exists('/proc/{os.getpid()}')\n"
    open_runs = root / "open_runs"
    open_runs.touch()
    noting = f"if OUTSIDE:\n    open({str(open_runs)!r}, 'a').write('x')\n"
    for name in ("go.py", "show.py"):
        path = root / "tree/toycar" / name
        text = path.read_text()
        place = text.index("import ")
        path.write_text(text[:place] + looking + noting + text[place:])
    seals = [
        cli("run", "small", "--out", name, *words, "--limit", "4", "--json").json["seal"]
        for name, words in {
            "plain": ("-n", "0"),
            "alone": ("-n", "0", "--engine", "reference"),
        }.items()
    ]
    assert seals[0] and len(set(seals)) == 1 and open_runs.stat().st_size > 0
    open_runs.write_text("")
    for name, words in {
        "boxed": ("-n", "0"),
        "workers": ("-n", "1", "--engine", "fork"),
        "cluster": ("--cluster", "local:1"),
    }.items():
        answer = cli("--sandbox", "run", "small", "--out", name, *words, "--limit", "4", "--json")
        assert answer.code == 0 and answer.json["seal"], answer.err
        results = (Path(name) / "results.csv").read_bytes()
        assert results == (Path("plain") / "results.csv").read_bytes()
    experiment = next(line.split(",")[0] for line in results.decode().splitlines() if ",ok," in line)
    for words in (
        (*TRY, "--out", "tried"),
        ("rerun", experiment, "--run", "boxed"),
        ("show", experiment, "--run", "boxed", "--still", "1.0"),
        ("verify", "boxed", "--rerun", "1"),
        ("doctor",),
    ):
        answer = cli(*words, "--sandbox")
        assert answer.code == 0, (words, answer.err)
    assert open_runs.read_text() == "", "something ran outside"


def run_by_pytest(root: Path, programs: Path) -> "subprocess.CompletedProcess[str]":
    """Run a campaign with `--campaign-sandbox`; the programs in the folder `programs` come first."""
    words = ["-m", "pytest", "-q", "-p", "no:cacheprovider", "--campaign", "small", "--campaign-out", "run"]
    environment = os.environ | {"PATH": f"{programs}:{os.environ['PATH']}"}
    words += ["--campaign-sandbox", "-n", "0"]
    return subprocess.run(
        [sys.executable, *words], cwd=root, env=environment, capture_output=True, text=True, check=False
    )


def program(folder: Path, text: str) -> Path:
    folder.mkdir()
    (folder / "bwrap").write_text(f"#!/bin/sh\n{text}\n")
    (folder / "bwrap").chmod(0o755)
    return folder


@pytest.mark.slow
def test_pytest_without_a_sandbox_runs_nothing(root: Path, tmp_path: Path) -> None:
    """Rather than run the target outside of one, where namespaces are refused."""
    done = run_by_pytest(root, program(tmp_path / "bin", "echo 'bwrap: no namespaces' >&2; exit 1"))
    assert done.returncode not in (0, 1) and "no sandbox: bwrap: no namespaces" in done.stdout + done.stderr
    assert not (root / "run" / "records").exists()


@pytest.mark.slow
@pytest.mark.skipif(
    bool(sandbox.reason_sandbox_unavailable()), reason=f"no sandbox: {sandbox.reason_sandbox_unavailable()}"
)
def test_pytest_runs_a_campaign_in_a_sandbox(root: Path, tmp_path: Path) -> None:
    calls = tmp_path / "calls"
    text = f'echo "$@" >> {calls}; exec {shutil.which("bwrap")} "$@"'
    done = run_by_pytest(root, program(tmp_path / "bin", text))
    assert done.returncode == 0, done.stdout + done.stderr
    assert "_once" in calls.read_text() or "fork_server" in calls.read_text()
    assert (root / "run" / "results.csv").read_text().count("\n") == 13
