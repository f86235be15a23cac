"""Campaigns on a foreign target, from the first command to the table."""

import csv
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

import mutator
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.reference_engine import ReferenceEngine
from mutator.errors import CheckFailed, MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.execution.experiment_runner import RecordedExperiment
from mutator.execution.session_summary import Summary
from mutator.execution.single_run import rerun_experiment, run_single
from mutator.execution.worker import Worker
from mutator.model import Experiment, Status
from mutator.store import plan_file
from mutator.store.packed_patches import PatchFolder
from mutator.store.plan_choices import Choices
from mutator.store.run_progress import Progress
from mutator.workspace import Workspace

CopyToycar = Callable[[Path], Workspace]


def rows_of(out: Path) -> list[dict[str, str]]:
    return list(csv.DictReader((out / "results.csv").open()))


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture
def toy(toy: Workspace, kept_checks: None) -> Workspace:
    return toy


@dataclass(frozen=True)
class Finished:
    """A small campaign run by two workers without any cache, and the target's files before and after it."""

    run: Path
    summary: Summary
    told: list[Progress]
    before: dict[str, bytes]
    after: dict[str, bytes]


@pytest.fixture(scope="module")
def finished_once(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> Finished:
    folder = tmp_path_factory.mktemp("finished")
    toy = copy_toycar(folder)
    tree = toy.library.parent / "tree"
    before, told = contents(tree), list[Progress]()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        summary = run_campaign(toy, "small", folder / "run", workers=2, notify=told.append)
    assert summary.exit_code == 0
    return Finished(folder / "run", summary, told, before, contents(tree))


@pytest.fixture
def finished(finished_once: Finished, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished_once.run, tmp_path / "finished"))


def test_bad_endings_are_not_harness_errors(toy: Workspace, tmp_path: Path) -> None:
    summary = run_campaign(toy, "hostile", tmp_path / "run")
    assert (summary.exit_code, summary.harness_errors, summary.problem) == (0, (), "")
    found = {row["fault_type"]: (row["status"], row["outcome"]) for row in rows_of(tmp_path / "run")}
    assert found == {
        "hang": ("timeout", ""),
        "crash": ("crashed", ""),
        "leave": ("crashed", ""),
        "segfault": ("crashed", ""),
        "hoard": ("crashed", ""),
        "unsound": ("invalid_mutant", ""),
        "silence": ("ok", "sdc"),
    }


def test_a_run_leaves_its_results_and_no_scratch_files(finished_once: Finished) -> None:
    out, summary, told = finished_once.run, finished_once.summary, finished_once.told
    assert finished_once.after == finished_once.before
    stages = {stage.stage for stage in told} - {"checks"}  # which end beside experiments, or after them
    assert stages == {"plan", "experiments", "proof", "tables"}
    assert [stage.done for stage in told if stage.stage == "experiments"][-1] == 12
    assert told[-2].done == told[-2].total == 3
    assert {p.name for p in out.iterdir()} == {
        "run.json",
        "campaign.yaml",
        "plan.csv",
        "plan",
        "checks.json",
        "digests.json",
        "golden",
        "patches",
        "proof",
        "records",
        "series",
        "timings",
        "results.csv",
        "results.json",
        "results.parquet",
        "propagation.parquet",
        "timings.parquet",
        "owner.lock",
    }
    assert summary.results is not None
    assert len(summary.results.read_text().splitlines()) == 1 + 12
    assert {p.name for p in (out / "golden").iterdir()} == {"A", "A+alone"}
    for row in rows_of(out):
        name = row["experiment_id"]
        assert (PatchFolder(out).read_patch(name) or b"").startswith(b"diff --git a/")


def test_the_next_command_deletes_half_written_files(toy: Workspace, finished: Path) -> None:
    places = (".run.json.7", "plan/.faults.jsonl.7", "report/tables/.a.csv.7", "series/.index.js.7")
    left = [finished / place for place in places]
    mine = finished / "report" / "tables" / ".notes"
    (finished / "report" / "tables").mkdir(parents=True)
    for path in (*left, mine):
        path.touch()
    assert run_campaign(toy, "small", finished).ran == 0
    assert [path.exists() for path in (*left, mine)] == [False, False, False, False, True]


@pytest.mark.skipif(shutil.which("patch") is None, reason="needs the program `patch`")
def test_a_stored_patch_produces_the_mutant(toy: Workspace, finished: Path, tmp_path: Path) -> None:
    row = next(row for row in rows_of(finished) if row["outcome"] == "sdc")
    name = row["experiment_id"]
    tree = tmp_path / "patched"
    shutil.copytree(toy.library.parent / "tree", tree, ignore=shutil.ignore_patterns("__pycache__"))
    subprocess.run(
        ["patch", "-p1", "-s", "-d", str(tree)], input=PatchFolder(finished).read_patch(name), check=True
    )
    single, same = rerun_experiment(toy, finished, name)
    assert same
    assert (tree / "toycar" / "_fi.py").is_file()
    assert single.mutant is not None
    for path, data in single.mutant.files.items():
        assert (tree / path).read_bytes() == data


def test_rerun_gives_the_same_record_and_a_trace(
    toy: Workspace, finished: Path, reseal: Callable[[Path], None]
) -> None:
    for row in rows_of(finished)[:3]:
        single, same = rerun_experiment(toy, finished, row["experiment_id"][:8])
        assert same
        assert single.faulty == finished / "traces" / row["experiment_id"] / "faulty"
        assert (single.faulty / "log.npz").is_file()
        assert single.golden == finished / "golden" / single.golden.name
        assert not (single.faulty.parent / "work").exists()
    for path in (finished / "records").iterdir():
        path.write_text(path.read_text().replace('"outcome":"', '"outcome":"masked","x":"'))
    reseal(finished)
    assert not rerun_experiment(toy, finished, single.experiment.id)[1]


def test_one_experiment_can_run_without_a_campaign(toy: Workspace, finished: Path, tmp_path: Path) -> None:
    experiment = plan_file.load_experiments(finished)[0]
    single = run_single(toy, toy.manifest("toycar"), experiment, tmp_path / "alone")
    assert single.record.status is Status.OK
    assert (single.golden / "log.npz").is_file()
    assert (tmp_path / "alone" / "mutant.patch").is_file()
    hostile = Choices(only='fault_type == "unsound"')
    run_campaign(toy, "hostile", tmp_path / "hostile", choices=hostile)
    unsound = plan_file.load_experiments(tmp_path / "hostile")[0]
    refused = run_single(toy, toy.manifest("toycar"), unsound, tmp_path / "alone")
    assert (refused.mutant, refused.record.status) == (None, Status.INVALID_MUTANT)
    (toy.library.parent / "tree" / "toycar" / "go.py").write_text("raise SystemExit(1)")
    with pytest.raises(CheckFailed, match="without any fault ended as crashed"):
        run_single(toy, toy.manifest("toycar"), experiment, tmp_path / "broken")


def test_experiments_with_harness_errors_are_rerun(
    toy: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    execute, hit = ReferenceEngine.execute, []

    def flaky(self: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        done = execute(self, job, folder)
        if job.mutant_id and len(job.name) == 16 and len(hit) < 2:
            hit.append(job.name)
            fields = {name: getattr(done, name) for name in ("out", "probe_report", "cpu_s", "wall_s")}
            return JobResult(status=Status.HARNESS_ERROR, detail="killed from outside by SIGKILL", **fields)
        return done

    monkeypatch.setattr(ReferenceEngine, "execute", flaky)
    out = tmp_path / "run"
    summary = run_campaign(toy, "small", out, engine="reference")
    assert (summary.exit_code, summary.done, summary.ran) == (3, 10, 10)
    assert dict(summary.harness_errors).keys() == set(hit)
    assert summary.outcomes["harness_error"] == 2
    assert sum(row["status"] == "harness_error" and row["outcome"] == "" for row in rows_of(out)) == 2
    again = run_campaign(toy, "small", out, engine="reference")
    assert (again.exit_code, again.done, again.ran) == (0, 12, 2)
    assert run_campaign(toy, "small", out).ran == 0


@pytest.mark.slow
def test_a_defect_in_a_worker_is_reported(
    toy: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, seen = Worker.run_and_store, []

    def broken(self: Worker, experiments: Sequence[Experiment]) -> Iterator[RecordedExperiment]:
        seen.append(experiments[0].id)
        if len(seen) == 2:
            raise ZeroDivisionError("seven")
        return run(self, experiments)

    monkeypatch.setattr(Worker, "run_and_store", broken)
    summary = run_campaign(toy, "small", tmp_path / "run")
    assert (summary.exit_code, summary.done) == (3, 11)
    assert f"{seen[1][:8]} failed because of a defect in mutator" in summary.problem
    assert "ZeroDivisionError: seven" in summary.problem


@pytest.mark.slow
def test_pytest_settings_of_the_user_do_not_reach_the_campaign(
    toy: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = {"PYTEST_ADDOPTS": "--no-such-option", "PYTEST_PLUGINS": "no_such_plugin"}
    for name, value in told.items():
        monkeypatch.setenv(name, value)
    summary = run_campaign(toy, "small", tmp_path / "run", workers=1, choices=Choices(limit=2))
    assert (summary.exit_code, summary.problem) == (0, "")
    assert {name: os.environ[name] for name in told} == told


@pytest.mark.slow
def test_scenarios_can_be_in_a_subfolder_of_the_library(toy: Workspace, tmp_path: Path) -> None:
    (toy.library / "scenarios" / "more").mkdir()
    shutil.move(toy.scenario("A"), toy.library / "scenarios" / "more" / "A.yaml")
    path = toy.campaign("small")
    path.write_text(path.read_text().replace("[A]", "[more/A]").replace("scenario: A", "scenario: more/A"))
    summary = run_campaign(toy, "small", tmp_path / "run", choices=Choices(limit=2))
    assert (summary.exit_code, summary.done) == (0, 2)
    assert mutator.verify(tmp_path / "run", workspace=toy).passed


def test_a_campaign_that_cannot_be_planned_leaves_no_folder(toy: Workspace, tmp_path: Path) -> None:
    (tmp_path / "old").mkdir()
    for out in (tmp_path / "new", tmp_path / "old"):
        with pytest.raises(MutatorError, match="no campaign"):
            run_campaign(toy, "nosuch", out)
        with pytest.raises(MutatorError, match="not approved"):
            run_campaign(toy, "small", out, reviewed=True)
    assert [path.name for path in tmp_path.iterdir() if path.name in ("new", "old")] == ["old"]


def test_a_run_refuses_options_that_differ_from_its_plan(toy: Workspace, finished: Path) -> None:
    assert run_campaign(toy, "small", finished, choices=Choices(seed=3)).exit_code == 0
    for choices in (
        Choices(seed=4),
        Choices(limit=3),
        Choices(only="value > 1"),
        Choices(reading="as_coded"),
    ):
        with pytest.raises(MutatorError, match="expected the value of this run's plan") as caught:
            run_campaign(toy, "small", finished, choices=choices)
        assert "None" not in str(caught.value)
    with pytest.raises(MutatorError, match="whose text differs"):
        run_campaign(toy, "toy", finished)
    assert run_campaign(toy, finished / "campaign.yaml", finished).exit_code == 0


def test_a_changed_target_is_refused(toy: Workspace, finished: Path) -> None:
    with (toy.library.parent / "tree" / "toycar" / "driver.py").open("a") as file:
        file.write("# edited\n")
    with pytest.raises(MutatorError, match="changed since this run was planned: target"):
        run_campaign(toy, "small", finished)
    with pytest.raises(MutatorError, match="changed since this run was planned: target"):
        rerun_experiment(toy, finished, rows_of(finished)[0]["experiment_id"])


FULL_DISK = """
import os, sys, threading, time
from pathlib import Path
from mutator.execution.campaign_running import run_campaign
from mutator.execution.experiment_runner import RecordedExperiment
from mutator.workspace import Workspace
out, workers = Path(sys.argv[2]) / "run", int(sys.argv[3])
toy = Workspace.find(root=Path(sys.argv[1]))
filler = out.parent / "filler"

def fill():
    while not any(p.read_bytes().count(b"\\n") > 2 for p in (out / "records").glob("*")):
        time.sleep(0.01)
    with filler.open("wb", buffering=0) as file:
        try:
            while True:
                file.write(bytes(4096))
        except OSError:
            pass

threading.Thread(target=fill).start()
first = run_campaign(toy, "small", out, workers=workers)
filler.unlink()
again = run_campaign(toy, "small", out, workers=workers)
print(first.exit_code, 2 <= first.done < 12, "no space left" in first.problem)
print(again.exit_code, again.done, again.ran == 12 - first.done)
sys.stdout.flush()
os.write(1, (out / "results.csv").read_bytes())
"""


@pytest.mark.slow
@pytest.mark.parametrize("workers", [0, 2])
def test_a_campaign_resumes_after_a_full_disk(
    toy: Workspace, finished: Path, tmp_path: Path, workers: int
) -> None:
    disk = tmp_path / "disk"
    disk.mkdir()
    script = f'mount -t tmpfs -o size=6m none "{disk}" && exec "$0" -c "$1" "$2" "{disk}" {workers}'
    command = ["unshare", "-rm", "sh", "-c", script, sys.executable, FULL_DISK, str(toy.library.parent)]
    try:
        answer = subprocess.run(command, capture_output=True, text=True, timeout=300)
    except FileNotFoundError:
        pytest.skip("needs unshare")
    if "unshare" in answer.stderr or "mount" in answer.stderr:
        pytest.skip("needs the right to mount a small file system")
    assert answer.returncode == 0, answer.stderr
    first, again, table = answer.stdout.split("\n", 2)
    assert first == "3 True True"
    assert again == "0 12 True"
    assert table == (finished / "results.csv").read_text()
