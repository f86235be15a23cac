"""Campaigns and benches that take results from earlier runs: the same files, and never another result."""

import dataclasses
import os
import shutil
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import mutator
from mutator import CheckFailed
from mutator._common.cache_layout_and_pruning import finished_runs_folder
from mutator.audit.run_audit import run_audit_checks
from mutator.campaigns import run_environment
from mutator.execution import finished_run_keys, loaded_packages, run_reuse
from mutator.execution.finished_run_keys import harness_digest
from mutator.execution.run_reuse import is_storable
from mutator.execution.session_summary import Summary
from mutator.execution.worker import Worker
from mutator.model import Record, RunError, Status
from mutator.store import plan_file
from mutator.store.checksummed_blocks import block_bytes, read_blocks
from mutator.store.finished_run_store import FinishedRun, FinishedRuns
from mutator.workspace import Workspace
from tests.run_contents import run_contents, run_modes

CopyToycar = Callable[[Path], Workspace]

LANE = mutator.Choices(only="fault_type == 'lane'")  # 4 of the 12 experiments

pytestmark = [
    pytest.mark.usefixtures("kept_checks"),
    pytest.mark.filterwarnings("ignore:no golden run reaches the trigger"),
]


def ran(toycar: Workspace, out: Path, **arguments: Any) -> Summary:
    summary = mutator.run("small", out, workspace=toycar, **{"engine": "fork"} | arguments).summary
    assert summary is not None
    return summary


@pytest.fixture(scope="module")
def first_run(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> Path:
    """The first run of the campaign in another copy of the toy car, in `run`, and its cache, in `cache`.

    Nearly every test begins with one, so it runs once for all of them.
    """
    folder = tmp_path_factory.mktemp("first")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
        assert ran(copy_toycar(folder), folder / "run").reused == 0
    return folder


@pytest.fixture
def first(first_run: Path, tmp_path: Path, kept_checks: None) -> Path:
    """A copy of the first run's folder, and its store of finished runs in the test's cache."""
    shutil.copytree(first_run / "cache" / "mutator" / "finished", finished_runs_folder())
    return Path(shutil.copytree(first_run / "run", tmp_path / "first"))


def replace_text(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_a_campaign_of_reused_runs_has_the_same_files(
    toycar: Workspace, first: Path, tmp_path: Path, workers: int
) -> None:
    """Records, patches, series, results and seal are those of a campaign that ran; only timings say that
    results were reused, and the audit finds nothing."""
    second = ran(toycar, tmp_path / "second", workers=workers)
    assert (second.reused, second.ran) == (12, 12)
    assert second.reuse_note == "12 of 12 reused: earlier runs had the same experiments"
    assert second.proof is not None
    assert (second.proof.sampled, second.proof.is_complete) == (3, True)
    assert run_contents(first) == run_contents(tmp_path / "second")
    assert run_modes(tmp_path / "second") == {"reused": 12}
    folder = mutator.load_run(tmp_path / "second").folder
    assert [d for check in run_audit_checks(folder, toycar) for d in check.differences] == []


def test_a_part_of_a_campaign_is_reused(toycar: Workspace, tmp_path: Path) -> None:
    """A campaign after a part of it runs the rest, and a part after it nothing."""
    part = ran(toycar, tmp_path / "part", choices=LANE)
    whole = ran(toycar, tmp_path / "whole")
    assert (part.reused, part.ran, whole.reused, whole.ran) == (0, part.ran, part.ran, 12)
    assert ran(toycar, tmp_path / "again", choices=LANE).reused == part.ran


@pytest.mark.usefixtures("first")
def test_without_reuse_everything_runs(toycar: Workspace, tmp_path: Path) -> None:
    """Neither `reuse=False` nor the reference engine takes anything from the store."""
    stored = sorted(finished_runs_folder().iterdir())
    assert ran(toycar, tmp_path / "second", choices=LANE, reuse=False).reused == 0
    assert ran(toycar, tmp_path / "third", choices=LANE, engine="reference").reused == 0
    assert run_modes(tmp_path / "third") == {"reference": 4}
    assert sorted(finished_runs_folder().iterdir()) == stored


def test_what_the_reference_engine_ran_is_reused_with_a_proof(toycar: Workspace, tmp_path: Path) -> None:
    ran(toycar, tmp_path / "first", choices=LANE, engine="reference")
    second = ran(toycar, tmp_path / "second", choices=LANE)
    assert second.reused == 4
    assert second.proof is not None
    assert second.proof.is_complete


@pytest.mark.usefixtures("first")
def test_after_an_edited_spec_only_its_experiments_run(toycar: Workspace, tmp_path: Path) -> None:
    """An edit of the text of a spec decides no result; an edit of its values does, for its experiments."""
    lane = toycar.library / "faults" / "sensor" / "lane.yaml"
    replace_text(lane, "The measured lateral", "The lateral")
    assert ran(toycar, tmp_path / "second").reused == 12
    replace_text(lane, "[0.0, 0.1], step: 0.8, last: [2.4, 2.5]", "[0.2, 0.3], step: 0.8, last: [2.6, 2.7]")
    third = ran(toycar, tmp_path / "third")
    experiments = plan_file.load_experiments(tmp_path / "third")
    assert third.reused == sum(experiment.fault.fault_type != "lane" for experiment in experiments) < 12


@pytest.mark.usefixtures("first")
@pytest.mark.parametrize("edited", ["target", "manifest"])
def test_after_an_edit_of_the_target_nothing_is_reused(
    toycar: Workspace, tmp_path: Path, edited: str
) -> None:
    """Neither after an edit of a file of the target, nor of the line of the hazards in the manifest."""
    if edited == "target":
        path = toycar.manifest("toycar").root / "toycar" / "driver.py"
        path.write_text(path.read_text() + "\n# edited\n")
    else:
        replace_text(toycar.library / "targets" / "toycar.yaml", "TOO_FAST]", "TOO_FAST]  # all")
    assert ran(toycar, tmp_path / "second", choices=LANE).reused == 0


@pytest.mark.usefixtures("first")
def test_runs_of_edited_code_are_not_reused_but_those_before_an_unrelated_package_are(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is reused after an edit of the rules of verdicts or of the records; everything is after another
    package was installed."""
    copy = tmp_path / "mutator"
    shutil.copytree(Path(mutator.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))
    before = harness_digest()
    monkeypatch.setattr(finished_run_keys, "_HARNESS_FOLDER", copy)
    harness_digest.cache_clear()
    assert harness_digest() == before
    installed = run_environment._installed_packages()
    reused = []
    for name in ("outcomes/verdict_rules.py", "model.py"):
        (copy / name).write_text((copy / name).read_text() + "\n")
        harness_digest.cache_clear()
        reused.append(ran(toycar, tmp_path / f"after {Path(name).stem}", choices=LANE).reused)
    monkeypatch.setattr(
        run_environment, "_installed_packages", lambda: {**installed, "unrelated": ("1.0", [])}
    )
    reused.append(ran(toycar, tmp_path / "after a package", choices=LANE, accept_versions=True).reused)
    harness_digest.cache_clear()
    assert reused == [0, 0, 4]


def test_a_run_that_loaded_a_package_needs_its_version(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Packages that the runs loaded are compared when a run is found."""
    monkeypatch.setattr(loaded_packages, "packages_loaded_by_golden_runs", lambda folder: ("pytest",))
    ran(toycar, tmp_path / "first", choices=LANE)
    assert ran(toycar, tmp_path / "second", choices=LANE).reused == 4
    installed = run_environment.package_versions()
    changed = {**installed, "pytest": "0.1"}
    monkeypatch.setattr(run_environment, "package_versions", lambda names=None: changed)
    monkeypatch.setattr("mutator.execution.session_reuse.surroundings_digest", stored_surroundings)
    assert ran(toycar, tmp_path / "third", choices=LANE, accept_versions=True).reused == 0


def test_a_run_that_loaded_an_editable_package_is_not_stored(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The package's code can change while its version stays."""
    monkeypatch.setattr(loaded_packages, "packages_loaded_by_golden_runs", lambda folder: ("pytest",))
    monkeypatch.setattr(run_environment, "_editable_packages", lambda: ("pytest",))
    ran(toycar, tmp_path / "first", choices=LANE)
    assert not FinishedRuns().has_any()


@pytest.mark.parametrize("is_in_golden", [True, False])
def test_a_run_that_loaded_a_module_of_no_package_is_not_stored(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_in_golden: bool
) -> None:
    """No version tells what such a file contains, whether golden runs load it or only a mutant does."""
    if is_in_golden:
        monkeypatch.setattr(loaded_packages, "unpackaged_modules_of_golden_runs", lambda folder: ("loose",))
    else:
        monkeypatch.setattr(loaded_packages, "_modules_outside", lambda mutant, modules: {"numpy", "loose"})
    ran(toycar, tmp_path / "first", choices=LANE)
    assert not FinishedRuns().has_any()


@pytest.mark.usefixtures("first")
def test_a_worker_with_other_code_leaves_the_store_alone(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Somebody can edit the harness after a session has begun, and before a worker does."""
    stored = {path.name for path in finished_runs_folder().glob("*.runs")}
    assert stored
    monkeypatch.setattr(run_reuse, "harness_digest", lambda: "edited")
    assert ran(toycar, tmp_path / "second", choices=LANE).reused == 0
    assert {path.name for path in finished_runs_folder().glob("*.runs")} == stored


def stored_surroundings(*arguments: object) -> str:
    (segment, *_) = FinishedRuns()._current_segments()
    (run, *_) = segment.runs_with_key(segment._row_key(0).hex())
    return run.surroundings


def test_a_damaged_store_is_not_believed(toycar: Workspace, first: Path, tmp_path: Path) -> None:
    """With each byte in the middle of a run changed, the run is repeated, with the same results."""
    (segment,) = finished_runs_folder().glob("*.runs")
    data = bytearray(segment.read_bytes())
    for place in range(200, len(data), 4000):
        data[place] ^= 1
    segment.write_bytes(data)
    assert ran(toycar, tmp_path / "second").reused < 12
    assert run_contents(first) == run_contents(tmp_path / "second")


@pytest.mark.usefixtures("first")
def test_a_run_of_another_mutant_is_not_believed(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even if its key is right, because tree and patch are compared."""
    find = FinishedRuns.find

    def find_another(store: FinishedRuns, key: str, is_usable: Callable[[FinishedRun], bool]) -> Any:
        def is_usable_as_other(run: FinishedRun) -> bool:
            return is_usable(dataclasses.replace(run, record=dataclasses.replace(run.record, patch="0" * 64)))

        return find(store, key, is_usable_as_other)

    monkeypatch.setattr(FinishedRuns, "find", find_another)
    assert ran(toycar, tmp_path / "second", choices=LANE).reused == 0


@pytest.mark.usefixtures("first")
def test_a_wrong_run_fails_its_proof_and_is_forgotten(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever stores a forged run is found out by the sample; the next campaign runs everything again."""
    find = FinishedRuns.find

    def find_forged(store: FinishedRuns, key: str, is_usable: Callable[[FinishedRun], bool]) -> Any:
        run = find(store, key, is_usable)
        return run and dataclasses.replace(run, record=dataclasses.replace(run.record, t_manifest=0.123))

    with monkeypatch.context() as patch:
        patch.setattr(FinishedRuns, "find", find_forged)
        with pytest.raises(CheckFailed, match="differs on the reference engine"):
            ran(toycar, tmp_path / "second")
    assert ran(toycar, tmp_path / "third", choices=LANE).reused == 0


def test_what_lost_its_proof_is_never_stored(
    toycar: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prove = Worker.prove_experiments

    def prove_wrongly(worker: Worker, experiments: Any) -> Any:
        append = worker._writer.append_proof
        worker._writer.append_proof = lambda record: append(dataclasses.replace(record, t_manifest=0.123))  # type: ignore[method-assign]
        yield from prove(worker, experiments)
        worker._writer.append_proof = append  # type: ignore[method-assign]

    with monkeypatch.context() as patch:
        patch.setattr(Worker, "prove_experiments", prove_wrongly)
        with pytest.raises(CheckFailed):
            ran(toycar, tmp_path / "first", choices=LANE)
    assert [*finished_runs_folder().glob("*")] == []
    assert ran(toycar, tmp_path / "second", choices=LANE).reused == 0


def killed_after(count: int, command: Callable[[], object]) -> None:
    """Run a command in a process that is killed after it has stored so many records."""
    store = Worker._store_finished
    stored = 0

    def store_and_count(worker: Worker, finished: Any) -> None:
        nonlocal stored
        store(worker, finished)
        stored += 1
        if stored == count:
            os.kill(os.getpid(), signal.SIGKILL)

    if not (pid := os.fork()):
        try:
            Worker._store_finished = store_and_count  # type: ignore[method-assign]
            command()
        finally:
            os._exit(9)
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == -signal.SIGKILL


def test_a_killed_campaign_is_stored_once_it_is_finished(toycar: Workspace, tmp_path: Path) -> None:
    """Nothing before its proof; then also what ran before the kill. Kills among reused runs lose nothing."""
    killed_after(5, lambda: ran(toycar, tmp_path / "first"))
    assert ran(toycar, tmp_path / "early", choices=mutator.Choices(limit=2)).reused == 0
    assert ran(toycar, tmp_path / "first").ran == 7
    killed_after(5, lambda: ran(toycar, tmp_path / "second"))
    second = ran(toycar, tmp_path / "second")
    assert (second.ran, second.reused) == (7, 7)
    assert run_modes(tmp_path / "second") == {"reused": 12}
    assert run_contents(tmp_path / "first") == run_contents(tmp_path / "second")


def test_notes_that_the_run_folder_does_not_confirm_are_not_stored(toycar: Workspace, tmp_path: Path) -> None:
    """A mutant can exchange keys or records in the notes of a run that goes on."""
    killed_after(8, lambda: ran(toycar, tmp_path / "first"))
    (notes,) = (path for path in finished_runs_folder().rglob("*") if path.is_file())
    exchange_keys(notes)
    ran(toycar, tmp_path / "first")
    assert ran(toycar, tmp_path / "second").reused == 4


def exchange_keys(notes: Path) -> None:
    blocks = read_blocks(notes).blocks
    keys = [block.key for block in blocks]
    exchanged = zip(keys[1:] + keys[:1], blocks, strict=True)
    notes.write_bytes(b"".join(block_bytes(block.kind, key, block.data) for key, block in exchanged))


def test_a_bench_and_a_campaign_share_runs(toycar: Workspace, first: Path, tmp_path: Path) -> None:
    """The same experiments, asked for in a bench, are taken from the campaign's, and have the records of a
    bench that runs them."""
    experiments = plan_file.load_experiments(first)
    with mutator.open_bench(toycar, tmp_path / "bench", campaign="small", seed=3, engine="fork") as bench:
        records = bench.run(experiments)
    assert run_modes(tmp_path / "bench") == {"reused": 12}
    assert {record.experiment_id: record for record in records} == dict(
        mutator.load_run(first).folder.records()
    )
    with mutator.open_bench(
        toycar, tmp_path / "alone", campaign="small", engine="fork", reuse=False
    ) as bench:
        assert bench.run(experiments) == records
    assert "reused" not in run_modes(tmp_path / "alone")


@pytest.mark.parametrize(
    ("status", "kind", "expected"),
    [
        (Status.OK, "", True),
        (Status.CRASHED, "ValueError", True),
        (Status.INVALID_MUTANT, "NameError", True),
        (Status.CRASHED, "MemoryError", False),
        (Status.CRASHED, "numpy._core._exceptions._ArrayMemoryError", False),
        (Status.CRASHED, "OSError", False),
        (Status.CRASHED, "PermissionError", False),
        (Status.TIMEOUT, "", False),
        (Status.HARNESS_ERROR, "", False),
    ],
)
def test_runs_that_limits_cut_off_are_not_stored(
    record: Callable[..., Record], status: Status, kind: str, expected: bool
) -> None:
    error = RunError(kind=kind, message="", place="") if kind else None
    ended = dataclasses.replace(record(), status=status, error=error, tree="1" * 64)
    assert is_storable(ended) is expected


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("/home/me/scenarios/A.yaml: no lead", False),
        ("no file '/tmp/x'", False),
        ("80 km/h, 1 / 2 of them", True),
    ],
)
def test_errors_that_name_a_path_are_not_stored(
    record: Callable[..., Record], message: str, expected: bool
) -> None:
    """In another clone, the same error names another path."""
    error = RunError(kind="ValueError", message=message, place="")
    ended = dataclasses.replace(record(), status=Status.CRASHED, error=error, tree="1" * 64)
    assert is_storable(ended) is expected


@pytest.mark.parametrize("detail", ["killed by SIGABRT", "left with status 1 without a report"])
def test_runs_that_ended_without_an_exception_are_not_stored(
    record: Callable[..., Record], detail: str
) -> None:
    """Native code that gets no memory ends so, and would go on with a higher limit."""
    ended = dataclasses.replace(record(), status=Status.CRASHED, detail=detail, tree="1" * 64)
    assert not is_storable(ended)
