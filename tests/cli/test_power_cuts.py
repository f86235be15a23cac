"""After a power cut, the disk has everything that was synced and any part of the rest."""

import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError
from mutator.execution.session import Session
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_rank_by_ok_experiment
from mutator.store import checksummed_blocks, checksummed_lines
from mutator.store.checksummed_blocks import read_blocks
from mutator.store.checksummed_lines import read_segment
from mutator.store.run_folder import RunFolder
from mutator.store.series_packing import list_unpacked_worker_files, pack_series
from mutator.store.time_series_folder import TimeSeriesFolder

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json
WORDS = ("run", "small", "--out", "run", "-n", "0", "--limit", 4, "--engine", "reference")


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """A list of the shared run folder and, once known, its seal."""
    return [tmp_path_factory.mktemp("shared") / "run"]


@pytest.fixture
def cut(cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch, shared: list[Any]) -> Path:
    """An unfinished run folder in which all experiments have run. All tests share it, because they have the
    same library."""

    def end(self: Session) -> None:
        raise MutatorError("the power is cut")

    kept = shared[0]
    if not kept.exists():
        with monkeypatch.context() as patch:
            patch.setattr(Session, "finish", end)
            assert "the power is cut" in cli(*WORDS).err
        shutil.copytree("run", kept)
    elif not Path("run").exists():
        shutil.copytree(kept, "run")
    return Path("run").resolve()


@pytest.fixture
def seal(cli: Cli, cut: Path, shared: list[Any]) -> str:
    if not shared[1:]:
        shutil.copytree(cut, "whole")
        whole = cli(*("whole" if word == "run" and place else word for place, word in enumerate(WORDS)))
        assert whole.code == 0, whole.err
        found = re.search(r"^seal: (\w+)$", whole.out, re.MULTILINE)
        assert found
        shared.append(found[1])
    return str(shared[1])


def last_block(path: Path) -> int:
    data = path.read_bytes()
    return data.rindex(b"FIB1", 0, read_blocks(path).blocks[-1].offset)


def test_files_are_synced_before_the_records_that_refer_to_them(
    cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: dict[str, int] = {}
    looks = []
    fsync = os.fsync

    def look(fd: int) -> None:
        fsync(fd)
        path = Path(f"/proc/self/fd/{fd}").readlink()
        synced[f"{path.parent.name}{path.suffix}"] = path.stat().st_size
        if path.parent.name != "records":
            return
        segment = read_segment(path)
        names = {segment.parse_line(number)["experiment_id"] for number in segment.lines if number > 1}
        for kind in ("patches", "series"):
            there = path.parents[1] / kind / f"{path.stem}.blocks"
            size = synced.get(f"{kind}.blocks", 0)
            found = read_blocks(there).blocks if size else ()
            kept = {one.key.split()[0] for one in found if one.offset + len(one.data) <= size}
            assert names <= kept
        looks.append(len(names))

    monkeypatch.setattr(os, "fsync", look)
    monkeypatch.setattr(checksummed_lines, "_MOST_UNSYNCED", 2)
    for module in (checksummed_lines, checksummed_blocks):
        monkeypatch.setattr(module, "_MOST_UNSYNCED_S", 1e9)
    ran = cli(*WORDS)
    assert ran.code == 0, ran.err
    assert looks[0] == 1 and max(looks) == 4


@pytest.mark.parametrize("rest", ["cut off", pytest.param("zeros", marks=pytest.mark.slow)])
def test_a_record_without_its_patch_is_refused(cli: Cli, cut: Path, seal: str, rest: str) -> None:
    [path] = (cut / "patches").iterdir()
    data, name = path.read_bytes(), read_blocks(path).blocks[-1].key
    for length in range(last_block(path), len(data)):
        path.write_bytes(data[:length].ljust(len(data) if rest == "zeros" else 0, b"\0"))
        if path.read_bytes() == data:  # the block ends with zeros
            continue
        with pytest.raises(MutatorError, match=f"no patch of {name}.*--repair") as told:
            RunFolder.open(cut)
        assert told.value.where == str(path)
    refused = cli(*WORDS)
    assert refused.code == 2 and f"no patch of {name}" in refused.err and "--repair" in refused.err
    assert cli("verify", "run").code == 1
    repaired = cli("verify", "run", "--repair")
    assert f"repaired: patch of {name} set aside" in repaired.out
    again = cli(*WORDS)
    assert again.code == 0, again.err
    assert "1 now" in again.out and f"seal: {seal}" in again.out
    assert cli("verify", "run").code == 0


@pytest.mark.slow
def test_a_lost_series_is_restored_by_a_rerun(cli: Cli, cut: Path) -> None:
    [path] = list_unpacked_worker_files(cut)
    data = path.read_bytes()
    names = [block.key.split()[0] for block in read_blocks(path).blocks if block.kind]
    records = RunFolder.open_unverified(cut).records()
    places = {one: place for place, one in enumerate(names)}
    for length in (*range(last_block(path), len(data), 7), len(data) - 1):
        run = Path(shutil.copytree(cut / "series", Path("cut") / "series")).parent
        (run / "series" / path.name).write_bytes(data[:length])
        pack_series(run, "p", places, 500)
        there = TimeSeriesFolder(run)
        assert [name for name in names if there.is_readable(name, records[name])] == names[:-1]
        assert there.load_series(names[-1], records[names[-1]]) is None
        shutil.rmtree(run)
    path.write_bytes(data[: last_block(path) + 30])
    ran = cli(*WORDS)
    assert ran.code == 0, ran.err
    assert [
        one
        for one in worst_first_rank_by_ok_experiment(Results(cut).frame())
        if not TimeSeriesFolder(cut).has_series(one)
    ] == names[-1:]
    assert cli("verify", "run").code == 0
    assert cli("rerun", names[-1], "--trace", "--run", "run").code == 0
    assert TimeSeriesFolder(cut).is_readable(names[-1], records[names[-1]])
