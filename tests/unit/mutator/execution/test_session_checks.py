"""Checks beside experiments: what has passed decides what runs, and a failed check leaves no result."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.comparison.compared_runs import load_compared_run
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.execution.session_checks import SessionChecks
from mutator.preflight.preflight_check_runner import CheckRunner
from mutator.results.table_building import ensure_tables
from mutator.store.finished_run_store import FinishedRuns
from mutator.store.run_folder import RunFolder
from mutator.store.run_progress import Progress
from mutator.workspace import Workspace

OTHER_GAP = '        case |= {"gap": 500.0, "lead_brakes": 0.0}\n'


def edit(toycar: Workspace, file: str, old: str, new: str) -> None:
    path = toycar.library.parent / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


MANY_WORKERS = 4  # those that wait for late checks, and one for experiments


@pytest.fixture
def late_checks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Callable[[], bool]]:
    """Let the canary and the runs of A+alone wait until experiments of A have records, and until all
    conditions hold that a test adds to the returned list.
    """
    conditions: list[Callable[[], bool]] = []
    run_job, judge_canary = CheckRunner.run_job, CheckRunner.judge_canary

    def wait_for_records() -> None:
        deadline = time.monotonic() + 120.0
        while time.monotonic() < deadline:
            files = [*tmp_path.glob("*/records/*.jsonl")]
            count = sum(len(file.read_bytes().splitlines()) - 1 for file in files)
            if count > 0 and all(holds() for holds in conditions):
                return
            time.sleep(0.05)

    def run_job_late(runner: CheckRunner, engine: Any, name: tuple[str, Any], job: Any) -> Any:
        if name[1] is not None and name[1].changes:
            wait_for_records()
        return run_job(runner, engine, name, job)

    def judge_canary_late(*arguments: Any) -> Any:
        wait_for_records()
        return judge_canary(*arguments)

    monkeypatch.setattr(CheckRunner, "run_job", run_job_late)
    monkeypatch.setattr(CheckRunner, "judge_canary", judge_canary_late)
    return conditions


def result_files(out: Path) -> dict[str, bytes]:
    names = ("checks.json", "results.csv", "plan.csv")
    files = [out / name for name in names] + sorted(path for path in (out / "golden").rglob("*.*"))
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in files if "json" not in path.name}


def test_results_are_those_of_checks_that_come_first(
    toycar: Workspace,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    late_checks: list[Callable[[], bool]],
) -> None:
    """The seal is the same, and while checks remain, the progress says that verdicts are provisional."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache1"))
    told: list[Progress] = []

    def has_told_provisional_verdicts() -> bool:
        return any("provisional: " in progress.detail and progress.done for progress in told)

    late_checks.append(has_told_provisional_verdicts)
    beside = run_campaign(
        toycar, "small", tmp_path / "beside", workers=MANY_WORKERS, reuse=False, notify=told.append
    )
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache2"))
    first = run_campaign(toycar, "small", tmp_path / "first", reuse=False)
    assert (beside.done, beside.exit_code) == (12, 0)
    assert beside.seals == first.seals
    assert beside.seals.seal is not None
    assert result_files(tmp_path / "beside") == result_files(tmp_path / "first")
    assert has_told_provisional_verdicts()


@pytest.mark.usefixtures("late_checks")
@pytest.mark.parametrize(
    ("file", "old", "new", "problem"),
    [
        (
            "tree/toycar/go.py",
            OTHER_GAP,
            OTHER_GAP.replace("500.0", "500.0 + hash('x') % 9"),
            "golden A+alone: two runs that differ in nothing but PYTHONHASHSEED",
        ),
        pytest.param(
            "tree/toycar/go.py",
            OTHER_GAP,
            OTHER_GAP.replace("500.0", "500.0 + len([*Path(__file__).parent.glob('*.py')])"),
            "null mutant A+alone: the probe alone changes what the target does",
            marks=pytest.mark.slow,
        ),
        (
            "fault_library/campaigns/small.yaml",
            "at_s: 1.0",
            "at_s: 5.9",
            "canary: did not reach H3",
        ),
    ],
    ids=["golden run", "null mutant", "canary"],
)
def test_a_check_that_fails_after_experiments_began_leaves_no_result(
    toycar: Workspace,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    file: str,
    old: str,
    new: str,
    problem: str,
) -> None:
    """No table, no seal, nothing in the store of finished runs. Records stay for a resume."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    edit(toycar, file, old, new)
    out = tmp_path / "run"
    counts = []
    for _ in range(2):
        with pytest.raises(CheckFailed, match=problem.replace("+", r"\+")):
            run_campaign(toycar, "small", out, workers=MANY_WORKERS)
        folder = RunFolder.open(out)
        counts.append(len(folder.records()))
        with pytest.raises(MutatorError, match="its verdicts are provisional"):
            load_compared_run(out)
        assert not folder.is_finished
        assert not (out / "results.csv").exists()
        assert not FinishedRuns().has_any()
        with pytest.raises(MutatorError, match="its verdicts are provisional"):
            ensure_tables(out)
    assert 0 < counts[0] <= counts[1]


def test_without_workers_all_checks_come_first(toycar: Workspace, tmp_path: Path) -> None:
    checks = SessionChecks(toycar, workers=0, secret=b"s", with_forks=False, notify=lambda progress: None)
    assert checks.describe_progress() == ""
    assert checks.can_use("A")
