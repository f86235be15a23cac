"""A finished run that this machine has verified before is verified again by comparing its bytes."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator._common import cache_layout_and_pruning
from mutator.errors import MutatorError
from mutator.execution.campaign_running import run_campaign
from mutator.execution.finished_outcome_cache import find_finished_run
from mutator.store import file_digests, integrity, verified_runs_cache
from mutator.store.packed_patches import PatchFolder
from mutator.store.packed_patches import rewrite_patch_file as rewrite_patches
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]
) -> tuple[Workspace, Path]:
    place = tmp_path_factory.mktemp("seeds")
    workspace = copy_toycar(place)
    path = workspace.campaign("small")
    path.write_text(path.read_text().replace("\nseed: 3\n", "\nseeds: {from: 3, to: 4}\nsample: 4\n"))
    assert run_campaign(workspace, "small", place / "run", engine="fork").exit_code == 0
    return workspace, place / "run"


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.mark.slow
def test_a_run_of_several_seeds_equals_a_run_of_each_seed(
    made: tuple[Workspace, Path], tmp_path: Path
) -> None:
    workspace, run = made
    several = RunFolder.open(run)
    path = workspace.campaign("small")
    for seed in (3, 4):
        alone = tmp_path / f"{seed}.yaml"
        alone.write_text(path.read_text().replace("seeds: {from: 3, to: 4}", f"seed: {seed}"))
        run_campaign(workspace, alone, tmp_path / str(seed), engine="reference")
        records = RunFolder.open(tmp_path / str(seed)).records()
        assert len(records) == 4
        assert all(several.records()[name] == records[name] for name in records)
    assert several.is_finished


def test_a_verified_run_is_only_compared_byte_for_byte(
    made: tuple[Workspace, Path], cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace, run = made
    first = run_campaign(workspace, "small", run)
    assert find_finished_run(RunFolder.open(run)) is not None

    def look(*arguments: object) -> None:
        raise AssertionError("verified again")

    monkeypatch.setattr(integrity, "record_problems", look)
    again = run_campaign(workspace, "small", run)
    for name in ("planned", "done", "ran", "outcomes", "proof", "seal", "results", "harness_errors"):
        assert getattr(again, name) == getattr(first, name), name
    with pytest.raises(AssertionError, match="verified again"):
        RunFolder.open(run).problems(ignore_cache=True)


def test_a_change_after_verification_is_found(made: tuple[Workspace, Path], cache: Path) -> None:
    run = made[1]
    RunFolder.open(run)
    patches = PatchFolder(run)
    [path] = patches.block_files()
    before, kept = path.read_bytes(), {name: patches.read_patch(name) or b"" for name in patches}
    try:
        name = next(iter(kept))
        rewrite_patches(path, [*(kept | {name: kept[name] + b"\n"}).items()])
        with pytest.raises(MutatorError, match=f"the patch of {name} is not the one that was run"):
            RunFolder.open(run)
    finally:
        path.write_bytes(before)
    RunFolder.open(run)


def test_a_damaged_entry_is_not_used(made: tuple[Workspace, Path], cache: Path) -> None:
    run = made[1]
    RunFolder.open(run)
    key = integrity.verified_cache_key(run)
    assert verified_runs_cache.recall_facts(key) == {"verified": True}
    [entry] = (cache / "mutator" / "runs").iterdir()
    entry.write_text(json.dumps(json.loads(entry.read_text()) | {"ended": {}}))
    assert verified_runs_cache.recall_facts(key) == {}
    entry.write_text("[]")
    assert verified_runs_cache.recall_facts(key) == {}


def test_an_unfinished_run_has_no_entry(made: tuple[Workspace, Path], cache: Path) -> None:
    run = made[1]
    ledger = file_digests.load_ledger(run)
    try:
        file_digests.save_ledger(run, file_digests.DigestLedger(files=ledger.files))
        assert integrity.verified_cache_key(run) == ""
    finally:
        file_digests.save_ledger(run, ledger)


@pytest.mark.slow
def test_space_is_freed_for_the_images_of_the_next_seed(
    made: tuple[Workspace, Path], cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []
    monkeypatch.setattr(cache_layout_and_pruning, "prune_target_cache", asked.append)
    run_campaign(made[0], "small", tmp_path / "run", choices=Choices(limit=4), engine="reference")
    goldens = len(RunFolder.open(tmp_path / "run").golden_runs)
    assert asked == ["toycar"] * (goldens + 2)
