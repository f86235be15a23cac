"""A run resumes with the Python and packages that it started with, or reports the difference."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator import load_run
from mutator._common import cache_layout_and_pruning
from mutator.campaigns import run_environment
from mutator.cli.app import main
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import CheckFailed
from mutator.execution.campaign_running import run_campaign
from mutator.execution.session import Session
from mutator.execution.session_items import SessionItems
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.store.session_progress import PROGRESS_FILE
from mutator.workspace import Workspace

CLONE = Path(__file__).parents[2]
Cli = Callable[..., tuple[int, str, str]]
Execute = Callable[[ReferenceEngine, Job, Path], JobResult]
PYTHONS = "CPython 3.11.7, here CPython 3.12.1"


class OnePiece:
    """A distributor that stops after two items."""

    def run(self, session: Session) -> None:
        items = SessionItems(session=session)
        runner = items.start_here()
        for item in items.list_work().items[:2]:
            runner.run(item)
        items.close(runner, is_stopped=True)
        session.problem = "interrupted"


@pytest.fixture
def cli(toy: Workspace, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Cli:
    monkeypatch.setenv("MUTATOR_ROOT", str(toy.library.parent))

    def run(*words: object) -> tuple[int, str, str]:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return (code, *capfd.readouterr())

    return run


@pytest.fixture
def half(toy: Workspace, tmp_path: Path, python: Callable[[str], None]) -> Path:
    """A run folder with two experiments run by Python 3.11.7. The current version is 3.12.1."""
    out = tmp_path / "half"
    python("3.11.7")
    assert run_campaign(toy, "small", out, distributor=OnePiece()).done == 2
    python("3.12.1")
    return out


@pytest.fixture
def python(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    return lambda version: monkeypatch.setattr("platform.python_version", lambda: version)


@pytest.fixture
def executed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    names: list[str] = []
    execute = ReferenceEngine.execute

    def noted(self: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        if job.mutant_id is None:
            names.append(job.name)
        return execute(self, job, folder)

    monkeypatch.setattr(ReferenceEngine, "execute", noted)
    return names


def other_digits(execute: Execute) -> Execute:
    """Simulate a machine that computes differently: append a space to an output file of the target."""

    def run(self: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        done = execute(self, job, folder)
        with (done.out / "said.json").open("a") as file:
            file.write(" ")
        return done

    return run


def contents(folder: Path) -> dict[Path, bytes]:
    """Return the bytes of all files but the one for those who watch a run, on which no result depends."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != PROGRESS_FILE)
    return {path: path.read_bytes() for path in files}


def test_another_python_is_refused(cli: Cli, half: Path) -> None:
    before = contents(half)
    code, _, err = cli("run", "small", "--out", half, "-n", "0")
    assert code == 2
    assert f"this run used other versions: {PYTHONS}" in err and "--accept-versions" in err
    assert contents(half) == before


@pytest.mark.slow
def test_another_python_can_be_accepted_and_is_recorded(
    cli: Cli, toy: Workspace, executed: list[str], half: Path, tmp_path: Path
) -> None:
    before = len(executed)
    code, _, err = cli("run", "small", "--out", half, "-n", "0", "--accept-versions")
    assert code == 0, err
    assert before == 4 and sorted(executed[:4]) == sorted(executed[4:])
    assert run_campaign(toy, "small", tmp_path / "whole").exit_code == 0
    assert (half / "results.csv").read_bytes() == (tmp_path / "whole" / "results.csv").read_bytes()
    stretches = json.loads((half / "run.json").read_text())["stretches"]
    assert [stretch["python"] for stretch in stretches] == ["CPython 3.11.7", "CPython 3.12.1"]
    assert [stretch["accepted"] for stretch in stretches] == [[], [PYTHONS]]
    report = (half / "report" / "REPORT.md").read_text()
    assert "CPython 3.11.7, CPython 3.12.1" in report and PYTHONS in report
    run = load_run(half)
    by = {e: stretch.python for e in run.records if (stretch := run.experiment(e).stretch)}
    assert sorted(by.values()) == ["CPython 3.11.7"] * 2 + ["CPython 3.12.1"] * 10
    # one experiment of each version
    for version, name in {version: name for name, version in by.items()}.items():
        code, out, _ = cli("show", name, "--run", half, "--no-plot")
        assert code == 0 and f"recorded on: {version}, " in out
    assert cli("run", "small", "--out", half, "-n", "0")[0] == 0  # nothing is left to run


def test_accepted_versions_must_compute_the_same_results(
    cli: Cli, half: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = contents(half)
    monkeypatch.setattr(ReferenceEngine, "execute", other_digits(ReferenceEngine.execute))
    code, _, err = cli("run", "small", "--out", half, "-n", "0", "--accept-versions")
    assert code == 1 and "differs from the one this run began with" in err
    assert contents(half) == before


@pytest.mark.slow
def test_pytest_refuses_and_accepts_versions_like_the_command(
    toy: Workspace, half: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("MUTATOR_ROOT", str(toy.library.parent))
    plain = ["-c", os.devnull, "-p", "no:cacheprovider", "--noconftest", "--rootdir", str(half)]
    words = [*plain, "--disable-plugin-autoload", "-p", "mutator"]
    words += ["--campaign", "small", "--campaign-out", str(half)]
    assert pytest.main(words) == 2
    assert PYTHONS in capfd.readouterr().out
    assert pytest.main([*words, "--accept-versions"]) == 0
    assert len(RunFolder.open(half).session_environments) == 2


@pytest.mark.slow
def test_another_machine_repeats_the_golden_runs(
    toy: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, executed: list[str]
) -> None:
    out = tmp_path / "run"
    run_campaign(toy, "small", out, distributor=OnePiece())
    assert sorted(executed) == ["a-A", "a-A+alone", "b-A", "b-A+alone"]
    run_campaign(toy, "small", out, distributor=OnePiece())
    assert len(executed) == 4  # this machine is already checked
    monkeypatch.setattr(run_environment, "processor_name", lambda: "another")
    assert run_campaign(toy, "small", out, distributor=OnePiece()).done == 6
    assert len(executed) == 8
    assert [stretch.cpu == "another" for stretch in RunFolder.open(out).session_environments] == [
        False,
        False,
        True,
    ]

    monkeypatch.setattr(run_environment, "processor_name", lambda: "a third")
    monkeypatch.setattr(ReferenceEngine, "execute", other_digits(ReferenceEngine.execute))
    before = contents(out)
    with pytest.raises(CheckFailed, match=r"the golden run A.* differs from the one this run began with"):
        run_campaign(toy, "small", out)
    assert contents(out) == before


Shard = Callable[..., Path]


@pytest.fixture
def shard(
    toy: Workspace, tmp_path: Path, python: Callable[[str], None], monkeypatch: pytest.MonkeyPatch
) -> Shard:
    def run(number: int, version: str = "3.11.7") -> Path:
        python(version)
        monkeypatch.setattr(run_environment, "processor_name", lambda: f"machine {number}")
        out = tmp_path / f"part{number}"
        assert run_campaign(toy, "small", out, choices=Choices(shard=f"{number}/2")).exit_code == 0
        return out

    return run


@pytest.mark.slow
def test_shards_of_other_versions_are_merged_only_if_accepted(cli: Cli, shard: Shard, tmp_path: Path) -> None:
    words = ("merge", shard(1, "3.11.7"), shard(2, "3.12.1"), "--out", tmp_path / "out")
    code, _, err = cli(*words)
    assert code == 2 and "part2: unlike " in err and PYTHONS in err and "--accept-versions" in err
    assert not (tmp_path / "out").exists()
    code, _, err = cli(*words, "--accept-versions")
    assert code == 0, err
    merged = RunFolder.open(tmp_path / "out")
    assert [s.python for s in merged.session_environments] == ["CPython 3.11.7", "CPython 3.12.1"]
    assert [list(s.accepted) for s in merged.session_environments] == [[], [PYTHONS]]
    run = load_run(tmp_path / "out")
    cpus = [stretch.cpu for e in run.records if (stretch := run.experiment(e).stretch)]
    assert sorted(cpus) == ["machine 1"] * 6 + ["machine 2"] * 6


@pytest.mark.slow
def test_shards_of_other_machines_merge_if_their_golden_runs_agree(
    cli: Cli, shard: Shard, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = shard(1)
    assert cli("merge", one, shard(2), "--out", tmp_path / "out")[0] == 0
    shutil.rmtree(tmp_path / "part2")
    monkeypatch.setattr(ReferenceEngine, "execute", other_digits(ReferenceEngine.execute))
    shutil.rmtree(cache_layout_and_pruning.cached_checks_folder())  # simulate another machine
    code, _, err = cli("merge", one, shard(2), "--out", tmp_path / "other")
    assert code == 1 and "the golden run A differs from the one in" in err


OTHER_PYTHONS = [f"python3.{minor}" for minor in range(11, 16) if minor != sys.version_info.minor]


@pytest.fixture(scope="module", params=OTHER_PYTHONS)
def other(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command `mutator`, installed for another Python."""
    name, home = request.param, tmp_path_factory.mktemp("other") / "environment"
    places = [*os.environ["PATH"].split(os.pathsep), *Path.home().glob(".pyenv/versions/*/bin")]
    found = [found for place in places if (found := shutil.which(name, path=place))]
    # a stub of pyenv is there, but fails
    python = next(
        (one for one in found if not subprocess.run([one, "-c", ""], capture_output=True).returncode), None
    )
    if python is None:
        pytest.skip(f"{name} is not installed")
    subprocess.run([python, "-m", "venv", home], check=True)
    # wheels only, because some packages take long to compile
    install = [home / "bin" / "pip", "install", "-q", "--only-binary", ":all:"]
    install += ["-c", CLONE / "constraints.txt", "-e", CLONE]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"mutator cannot be installed for {name}: {done.stderr[-500:]}")
    return home / "bin" / "mutator"


@pytest.mark.slow
def test_another_installed_python_resumes_only_if_accepted(
    other: Path, toy: Workspace, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    assert run_campaign(toy, "small", out, distributor=OnePiece()).done == 2

    def run(*words: str) -> "subprocess.CompletedProcess[str]":
        command = [other, "run", "small", "--out", out, *words]
        places = {"MUTATOR_ROOT": str(toy.library.parent)}
        return subprocess.run(command, env=os.environ | places, capture_output=True, text=True, check=False)

    refused = run()
    assert (
        refused.returncode == 2 and f"{run_environment.python_version()}, here CPython 3." in refused.stderr
    )
    accepted = run("--accept-versions")
    assert accepted.returncode == 0, accepted.stderr
    assert "12 of 12 experiments done, 10 now" in accepted.stderr + accepted.stdout
    assert len({stretch.python for stretch in RunFolder.open(out).session_environments}) == 2


@pytest.fixture(scope="module")
def quickstart_results(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    out = tmp_path_factory.mktemp("quickstart") / "run"
    run_campaign(Workspace.find(root=CLONE), "quickstart", out, workers=2)
    return (out / "results.csv").read_bytes()


@pytest.mark.slow
def test_another_installed_python_gives_the_same_results(
    other: Path, quickstart_results: bytes, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    subprocess.run([other, "run", "quickstart", "--out", out, "-n", "2"], cwd=CLONE, check=True)
    assert (out / "results.csv").read_bytes() == quickstart_results
