"""Shards from elsewhere are merged without reaching anything outside of them and of the result."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from mutator.errors import MutatorError, UnsafePath
from mutator.execution.shard_merging import _merged_checks, merge_shards
from mutator.limits import Limits, MeasuredLimits
from mutator.store import file_digests
from mutator.store.checks_file import CHECKS_FILE, CHECKS_SCHEMA, limits_of_run
from mutator.store.file_digests import FileDigest
from mutator.workspace import Workspace


@pytest.fixture
def shard(toycar: Workspace, tmp_path: Path, write_finished: Callable[..., Path]) -> Path:
    run = write_finished(toycar, tmp_path / "sent" / "runs" / "part", shard="1/1")
    shutil.rmtree(run / "proof")
    ledger = file_digests.load_ledger(run)
    files = {name: one for name, one in ledger.files.items() if not name.startswith("proof/")}
    file_digests.save_ledger(run, replace(ledger, files=files))
    return run


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return tmp_path / "home" / "runs" / "whole"


def test_a_single_shard_is_merged(shard: Path, out: Path) -> None:
    assert merge_shards([shard], out) == out / "results.csv"


def test_a_shard_whose_check_failed_is_refused(shard: Path, out: Path) -> None:
    """Its experiments can have run beside the check."""
    path, ledger = shard / CHECKS_FILE, file_digests.load_ledger(shard)
    failed = {"name": "canary", "passed": False, "detail": "did not reach H3"}
    path.write_text(json.dumps(json.loads(path.read_text()) | {"results": [failed]}))
    digests = {**ledger.files, CHECKS_FILE: FileDigest.of_bytes(path.read_bytes())}
    file_digests.save_ledger(shard, replace(ledger, files=digests))
    with pytest.raises(MutatorError, match="provisional"):
        merge_shards([shard], out)


@pytest.mark.parametrize("name", ["../../setup.py", "golden/../../../setup.py", "setup.py"])
def test_a_file_that_the_ledger_should_not_name_is_not_copied(shard: Path, out: Path, name: str) -> None:
    theirs, mine = shard / name, out / name
    theirs.write_text("theirs")
    ledger = file_digests.load_ledger(shard)
    file_digests.save_ledger(
        shard, replace(ledger, files={**ledger.files, name: FileDigest.of_bytes(b"theirs")})
    )
    mine.parent.mkdir(parents=True, exist_ok=True)
    if mine.resolve().parent != out.resolve():
        mine.resolve().write_text("mine")
    with pytest.raises(UnsafePath, match=r"digests\.json"):
        merge_shards([shard], out)
    assert not mine.resolve().exists() or mine.resolve().read_text() == "mine"


@pytest.mark.parametrize("name", ["workers", "records", "report", "series", "golden/A", "work", "plan"])
def test_a_shard_with_a_link_is_refused(shard: Path, out: Path, name: str) -> None:
    shutil.rmtree(shard / name, ignore_errors=True)
    (shard / name).symlink_to(out.parent)
    with pytest.raises(UnsafePath, match=f"{name}: a link"):
        merge_shards([shard], out)
    assert not out.parent.exists()


@pytest.mark.parametrize("name", ["workers", "owner.lock", "plan", "campaign.yaml", ".run.json.1"])
def test_nothing_is_merged_into_a_folder_with_a_link(shard: Path, out: Path, name: str) -> None:
    out.mkdir(parents=True)
    mine = out.parent / "mine"
    mine.mkdir()
    (mine / "1").write_text("mine")
    (out / name).symlink_to(mine)
    with pytest.raises(UnsafePath, match="a link"):
        merge_shards([shard], out)
    assert [path.read_text() for path in mine.iterdir()] == ["mine"]


def test_the_longest_limits_of_the_shards_are_kept(tmp_path: Path) -> None:
    """What finished in a shard on a slow machine must also finish when it is repeated."""
    shards = []
    for name, cpu_s, wall_s in (("one", 10, 600), ("two", 20, 300)):
        (tmp_path / name).mkdir()
        measured = {"cpu_s": cpu_s, "wall_s": wall_s}
        checks = {"schema": CHECKS_SCHEMA, "goldens": {}, "measured_limits": measured}
        (tmp_path / name / CHECKS_FILE).write_text(json.dumps(checks))
        shards.append(SimpleNamespace(path=tmp_path / name, limits=limits_of_run(tmp_path / name, Limits())))
    (tmp_path / "whole").mkdir()
    (tmp_path / "whole" / CHECKS_FILE).write_bytes(_merged_checks(shards))  # type: ignore[arg-type]
    assert limits_of_run(tmp_path / "whole", Limits()) == MeasuredLimits(cpu_s=20, wall_s=600)
