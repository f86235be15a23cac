"""Cached results of the checks before a campaign."""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator._common import cached_folders
from mutator._common.files import json_bytes
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.engines.engine_jobs import Job, JobResult
from mutator.engines.reference_engine import ReferenceEngine
from mutator.preflight import preflight_cache
from mutator.preflight.check_run_problems import output_digest_of
from mutator.preflight.preflight_checks import run_checks
from mutator.store.plan_choices import Choices
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

CopyToycar = Callable[[Path], Workspace]


@pytest.fixture(scope="module")
def checked(tmp_path_factory: pytest.TempPathFactory, copy_toycar: CopyToycar) -> tuple[Workspace, RunFolder]:
    root = tmp_path_factory.mktemp("checked")
    toy = copy_toycar(root)
    folder = freeze_plan(build_plan(toy, "small"), root / "run", toy)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_CACHE_HOME", str(root / "cache"))
        run_checks(toy, folder)
    return toy, folder


@pytest.fixture
def cache(checked: tuple[Workspace, RunFolder], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    copied = shutil.copytree(checked[1].path.parent / "cache", tmp_path / "cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(copied))
    (entry,) = (tmp_path / "cache" / "mutator" / "checks").iterdir()
    return entry


class RunStarted(Exception):
    pass


@pytest.fixture
def only_null_mutants_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Refuse golden runs and the canary, which only checks that are not cached need."""
    genuine = ReferenceEngine.execute

    def execute(engine: ReferenceEngine, job: Job, folder: Path) -> JobResult:
        if not job.name.startswith("n-"):
            raise RunStarted
        return genuine(engine, job, folder)

    monkeypatch.setattr(ReferenceEngine, "execute", execute)


@pytest.mark.usefixtures("cache", "only_null_mutants_start")
def test_another_folder_uses_the_cached_results(checked: tuple[Workspace, RunFolder], tmp_path: Path) -> None:
    toy, before = checked
    folder = freeze_plan(build_plan(toy, "small", Choices(only='method == "guided"')), tmp_path / "run", toy)
    assert all(result.passed for result in run_checks(toy, folder))
    assert (folder.path / "checks.json").read_bytes() == (before.path / "checks.json").read_bytes()
    files = [p.relative_to(before.path) for p in (before.path / "golden").rglob("*") if p.is_file()]
    assert len(files) == 4
    assert all((folder.path / f).read_bytes() == (before.path / f).read_bytes() for f in files)


@pytest.mark.usefixtures("only_null_mutants_start")
@pytest.mark.parametrize("damaged", ["checks.json", "golden/A/log.npz", "golden/A+alone/said.json", ""])
@pytest.mark.parametrize("content", [b"", b"{}", None])
def test_a_damaged_entry_is_ignored(
    checked: tuple[Workspace, RunFolder], tmp_path: Path, cache: Path, damaged: str, content: bytes | None
) -> None:
    if not damaged:
        shutil.rmtree(cache)
    elif content is None:
        (cache / damaged).unlink()
    else:
        (cache / damaged).write_bytes(content)
    toy, _ = checked
    folder = freeze_plan(build_plan(toy, "small"), tmp_path / "run", toy)
    with pytest.raises(RunStarted):
        run_checks(toy, folder)


@pytest.mark.usefixtures("only_null_mutants_start")
@pytest.mark.parametrize("how", ["another word in a result", "another file", "a pipe"])
def test_a_changed_entry_is_ignored(
    checked: tuple[Workspace, RunFolder], tmp_path: Path, cache: Path, how: str
) -> None:
    """The results and golden runs of an entry become part of a seal."""
    if how == "another file":
        shutil.copy(cache / "golden" / "A" / "log.npz", cache / "golden" / "A" / "log2.npz")
    elif how == "a pipe":
        (cache / "sum").unlink()
        os.mkfifo(cache / "sum")
    else:
        text = (cache / "checks.json").read_text()
        assert "the same bytes twice" in text
        (cache / "checks.json").write_text(text.replace("the same bytes twice", "the same bytes thrice"))
    toy, _ = checked
    folder = freeze_plan(build_plan(toy, "small"), tmp_path / "run", toy)
    with pytest.raises(RunStarted):
        run_checks(toy, folder)


@pytest.mark.usefixtures("cache", "only_null_mutants_start")
@pytest.mark.parametrize("changed", ["seed", "target", "machine"])
def test_another_seed_target_or_machine_has_no_entry(
    checked: tuple[Workspace, RunFolder],
    toycar: Workspace,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    changed: str,
) -> None:
    if changed == "machine":
        monkeypatch.setattr("platform.node", lambda: "elsewhere")
    if changed == "target":
        with (toycar.library.parent / "tree" / "toycar" / "go.py").open("a") as file:
            file.write("# another\n")
    plan = build_plan(toycar, "small", Choices(seed=9 if changed == "seed" else None))
    with pytest.raises(RunStarted):
        run_checks(toycar, freeze_plan(plan, tmp_path / "run", toycar))


@pytest.mark.usefixtures("only_null_mutants_start")
def test_a_forged_golden_run_is_ignored(
    checked: tuple[Workspace, RunFolder], tmp_path: Path, cache: Path
) -> None:
    """Whoever can write to the cache can compute its digests."""
    toy, _ = checked
    manifest, place = toy.manifest("toycar"), cache / "golden" / "A"
    (place / "said.json").write_text((place / "said.json").read_text() + " ")
    told = json.loads((cache / "checks.json").read_text())
    told["goldens"]["A"] = output_digest_of(manifest, place)
    (cache / "checks.json").write_bytes(json_bytes(told))
    (cache / "sum").unlink()
    (cache / "sum").write_bytes(cached_folders._digest_of_files(cache))
    folder = freeze_plan(build_plan(toy, "small"), tmp_path / "run", toy)
    with pytest.raises(RunStarted):
        run_checks(toy, folder)


def test_a_damaged_entry_is_replaced(checked: tuple[Workspace, RunFolder], cache: Path) -> None:
    good = (cache / "checks.json").read_bytes()
    (cache / "checks.json").write_bytes(b"")
    preflight_cache.store_passed_checks(cache, checked[1].path, "checks.json", checked[1].scratch_folder)
    assert (cache / "checks.json").read_bytes() == good
    assert list(cache.parent.iterdir()) == [cache]


def test_a_cache_that_cannot_be_created_is_not_an_error(
    checked: tuple[Workspace, RunFolder], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    preflight_cache.store_passed_checks(
        tmp_path / "file" / "entry", checked[1].path, "checks.json", checked[1].scratch_folder
    )
    assert (tmp_path / "file").read_text() == ""
