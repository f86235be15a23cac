"""A campaign on a Dask cluster gives the bytes of a local run, even if processes die."""

import os
import random
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mutator.campaigns import run_environment
from mutator.errors import MutatorWarning
from mutator.execution.campaign_running import run_campaign
from mutator.execution.cluster import bundle
from mutator.execution.distributor_choice import choose_distributor
from mutator.execution.session_summary import Summary
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .command import Bytes, Command, pytest_words, results
from .machines import Machines

CLONE = Path(__file__).parents[2]
CopyToycar = Callable[[Path], Workspace]
INT, TERM, KILL, STOP = signal.SIGINT, signal.SIGTERM, signal.SIGKILL, signal.SIGSTOP


@pytest.fixture
def toy(toy: Workspace, kept_checks: None) -> Workspace:
    return toy


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> tuple[Bytes, str]:
    folder = tmp_path_factory.mktemp("undisturbed")
    summary = run_campaign(copy_toycar(folder), "small", folder / "run", workers=2, engine="fork")
    assert (summary.exit_code, summary.done) == (0, 12)
    assert summary.seal is not None
    return results(folder / "run"), summary.seal


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machines]:
    """A scheduler with two workers. Tests must not stop them."""
    machines = Machines(tmp_path_factory.mktemp("two") / "machines", nanny=False)
    machines.add("alpha")
    machines.add("beta")
    yield machines
    machines.end()


@pytest.fixture
def machines(tmp_path: Path) -> Iterator[Machines]:
    found = Machines(tmp_path / "machines")
    yield found
    found.end()


def on(machines: Machines, toy: Workspace, out: Path, **more: object) -> Summary:
    deals = choose_distributor(str(machines.file))
    return run_campaign(toy, "small", out, engine="fork", distributor=deals, **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_two_workers_give_the_same_bytes(
    toy: Workspace, tmp_path: Path, undisturbed: tuple[Bytes, str], two: Machines
) -> None:
    out = tmp_path / "run"
    summary = on(two, toy, out)
    assert (summary.exit_code, summary.problem, summary.done) == (0, "", 12)
    assert (results(out), summary.seal) == undisturbed
    assert summary.proof is not None and summary.proof.is_complete
    folder = RunFolder.open(out)
    assert len(folder.session_environments[-1].machines) == 2
    assert two.children() == []
    assert not [*two.folder.glob("*/dask/**/mutator-*")]


@pytest.mark.slow
def test_pytest_distributes_experiments_to_a_cluster(
    toy: Workspace, tmp_path: Path, undisturbed: tuple[Bytes, str], two: Machines
) -> None:
    words = [*pytest_words(tmp_path / "run", workers=0), "--campaign-cluster", str(two.file)]
    words = [word for word in words if word not in ("-n", "0")]
    command = Command(toy, tmp_path / "run", *words)
    said = command.process.communicate(timeout=120)[0]
    assert command.process.returncode == 0, said
    tables = results(tmp_path / "run")
    assert tables["results.csv"] == undisturbed[0]["results.csv"]


@pytest.mark.slow
def test_workers_that_do_not_reproduce_the_golden_run_are_refused(
    toy: Workspace, tmp_path: Path, two: Machines, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = bundle.read_json
    monkeypatch.setattr(
        bundle,
        "read_json",
        lambda *given: real(*given) | {"goldens": dict.fromkeys(real(*given)["goldens"], "0" * 64)},
    )
    with pytest.warns(MutatorWarning, match=r"worker alpha.*CPython.*gets no work: golden run"):
        summary = on(two, toy, tmp_path / "run")
    assert summary.exit_code == 3
    assert summary.done == 0
    assert "no worker is left to do the work: golden run" in summary.problem


def test_a_worker_with_another_version_is_refused(
    toy: Workspace, tmp_path: Path, two: Machines, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = run_environment.package_versions
    monkeypatch.setattr(
        run_environment, "package_versions", lambda names=None: real(names) | {"numpy": "1.0"}
    )
    with pytest.warns(MutatorWarning, match=r"worker beta.*gets no work: numpy 1\.0, there 2"):
        summary = on(two, toy, tmp_path / "run")
    assert "no worker is left" in summary.problem


@pytest.mark.parametrize(("number", "code"), [(KILL, -KILL), (INT, 130)], ids=["KILL", "INT"])
@pytest.mark.slow
def test_workers_stop_when_their_command_dies(
    toy: Workspace,
    tmp_path: Path,
    two: Machines,
    undisturbed: tuple[Bytes, str],
    number: signal.Signals,
    code: int,
) -> None:
    out = tmp_path / "run"
    words = ["-m", "mutator", "run", "small", "--out", str(out)]
    words += ["--engine", "fork", "--cluster", str(two.file)]
    command = Command(toy, out, *words)
    command.wait_for_records(1)
    assert two.children()
    os.kill(command.process.pid, number)
    assert command.process.wait() == code
    deadline = time.monotonic() + 10.0
    while two.children():
        assert time.monotonic() < deadline
        time.sleep(0.1)
    again = on(two, toy, out)
    assert (again.exit_code, again.done) == (0, 12)
    assert 0 < again.ran < 12
    assert results(out) == undisturbed[0]


KILLS = [(number, seed) for seed in range(5) for number in (INT, TERM, KILL, STOP)]


@pytest.mark.slow
@pytest.mark.parametrize(("number", "seed"), KILLS, ids=[f"{n.name}-{s}" for n, s in KILLS])
def test_workers_killed_at_random_change_no_byte(
    toy: Workspace,
    tmp_path: Path,
    machines: Machines,
    number: signal.Signals,
    seed: int,
    whole_toy: tuple[Bytes, str],
) -> None:
    draw = random.Random(f"{number} {seed}")
    for name in ("alpha", "beta"):
        machines.add(name)
    ended = threading.Event()

    def strike() -> None:
        time.sleep(draw.uniform(2.0, 6.0))
        machines.add("gamma")
        for _ in range(3):
            machines.strike(draw.choice(("alpha", "beta")), number)
            if ended.wait(draw.uniform(1.0, 5.0)):
                return

    thread = threading.Thread(target=strike)
    thread.start()
    try:
        deals = choose_distributor(str(machines.file))
        summary = run_campaign(toy, "toy", tmp_path / "run", engine="fork", distributor=deals)
    finally:
        ended.set()
        thread.join()
    assert (summary.exit_code, summary.problem) == (0, "")
    assert (results(tmp_path / "run"), summary.seal) == whole_toy


@pytest.fixture(scope="module")
def whole_toy(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> tuple[Bytes, str]:
    folder = tmp_path_factory.mktemp("whole")
    summary = run_campaign(copy_toycar(folder), "toy", folder / "run", workers=2, engine="fork")
    assert summary.exit_code == 0
    assert summary.seal is not None
    return results(folder / "run"), summary.seal


_UNLIKE = """\
import sys
if any("cluster.piece_process" in word for word in sys.orig_argv):
    from dataclasses import replace
    from mutator.preflight import check_run_problems
    real = check_run_problems.read_check_run
    check_run_problems.read_check_run = lambda *given: replace(real(*given), output_digest="f" * 64)
"""
_OTHER = "import mutator._common.version as version\nversion.VERSION = '0.0.1'\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "why"),
    [
        (_UNLIKE, r"golden run .* has the digest ffffffffffffffff here"),
        (_OTHER, r"mutator 0\.0\.1, here "),
    ],
    ids=["arithmetic", "version"],
)
def test_other_workers_do_the_work_of_a_refused_one(
    toy: Workspace, tmp_path: Path, machines: Machines, whole_toy: tuple[Bytes, str], code: str, why: str
) -> None:
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "sitecustomize.py").write_text(code)
    machines.add("alpha")
    machines.add("odd", PYTHONPATH=str(tmp_path / "site"))
    with pytest.warns(MutatorWarning, match=rf"worker odd at .*gets no work: {why}"):
        summary = run_campaign(
            toy, "toy", tmp_path / "run", engine="fork", distributor=choose_distributor(str(machines.file))
        )
    assert (summary.exit_code, summary.problem) == (0, "")
    assert (results(tmp_path / "run"), summary.seal) == whole_toy
    [machine] = RunFolder.open(tmp_path / "run").session_environments[-1].machines
    assert machine.worker.startswith("alpha")


@pytest.mark.slow
def test_a_campaign_resumes_with_a_new_scheduler(
    toy: Workspace, tmp_path: Path, machines: Machines, whole_toy: tuple[Bytes, str]
) -> None:
    machines.add("alpha")
    out = tmp_path / "run"

    def kill() -> None:
        while not any(path.read_bytes().count(b"\n") > 1 for path in (out / "records").glob("*.jsonl")):
            time.sleep(0.1)
        os.killpg(machines.scheduler.pid, KILL)

    thread = threading.Thread(target=kill)
    thread.start()
    summary = run_campaign(toy, "toy", out, engine="fork", distributor=choose_distributor(str(machines.file)))
    thread.join()
    assert summary.exit_code == 3
    assert "no longer answers" in summary.problem
    assert 0 < summary.done < summary.planned
    machines.start_scheduler()
    machines.add("beta")
    again = run_campaign(toy, "toy", out, engine="fork", distributor=choose_distributor(str(machines.file)))
    assert (again.exit_code, again.done, again.ran) == (0, summary.planned, summary.planned - summary.done)
    assert (results(out), again.seal) == whole_toy


@pytest.mark.slow
@pytest.mark.parametrize("campaign", ["quickstart", "paper_smoke"])
def test_shipped_campaigns_give_the_same_bytes_on_three_workers(
    tmp_path: Path, machines: Machines, campaign: str
) -> None:
    shipped = Workspace.find(CLONE)
    here = run_campaign(shipped, campaign, tmp_path / "here", workers=2)
    assert here.exit_code == 0
    for name in ("alpha", "beta", "gamma"):
        machines.add(name)
    there = run_campaign(
        shipped, campaign, tmp_path / "there", distributor=choose_distributor(str(machines.file))
    )
    assert (there.exit_code, there.problem) == (0, "")
    assert results(tmp_path / "there") == results(tmp_path / "here")
    assert there.seal == here.seal
