"""The store of finished runs: what is stored is found, and damage is never believed."""

import os
import random
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path

import pytest

from mutator._common import cache_layout_and_pruning
from mutator._common.cache_layout_and_pruning import finished_runs_folder
from mutator._common.hashing import digest
from mutator.model import Outcome, Record, Status
from mutator.store import finished_run_store
from mutator.store.finished_run_store import FinishedRun, FinishedRuns, UnprovedRuns, store_finished_runs


def finished_run(number: int, series: bytes | None = b"series\nof a run") -> FinishedRun:
    record = Record(
        experiment_id=f"{number:016x}",
        status=Status.OK,
        outcome=Outcome.SDC,
        detail="",
        tree=digest(["tree", number]),
        activation=None,
        t_manifest=1.5,
        max_dev=(("gas", 0.1 * number),),
        hazards=(),
        alerts=(),
        trace_digest=digest(["trace", number]),
    )
    return FinishedRun(record=record, packages={"numpy": "2.0"}, surroundings="around", faulty_series=series)


def runs_by_key(numbers: range) -> dict[str, FinishedRun]:
    return {digest(["key", number]): finished_run(number) for number in numbers}


def find(key: str, is_usable: Callable[[FinishedRun], bool] = lambda run: True) -> FinishedRun | None:
    return FinishedRuns().find(key, is_usable)


def segments() -> list[Path]:
    return sorted(finished_runs_folder().glob("*.runs"))


def test_a_stored_run_is_found_by_its_key_alone() -> None:
    """Runs with and without a series come back as they were; another key finds nothing."""
    runs = runs_by_key(range(50)) | {digest("bare"): finished_run(50, None)}
    store_finished_runs(runs.items())
    assert {key: find(key) for key in runs} == runs
    assert find(digest("other")) is None


def test_a_run_that_cannot_be_used_is_passed_over() -> None:
    """The search goes on to another run with the same key."""
    key, old, new = digest("key"), finished_run(1), finished_run(2)
    store_finished_runs([(key, old)])
    store_finished_runs([(key, new)])
    assert find(key, lambda run: run == new) == new
    assert find(key, lambda run: False) is None


def test_an_open_store_finds_what_others_add_and_survives_what_they_delete() -> None:
    opened, (key, run) = FinishedRuns(), next(iter(runs_by_key(range(1)).items()))
    assert not opened.has_any()
    store_finished_runs([(key, run)])
    os.utime(finished_runs_folder(), (1, 1))  # the clock of a file system can be coarse
    assert opened.find(key, lambda run: True) == run
    segments()[0].unlink()
    assert opened.find(key, lambda run: True) is None


def damage(segment: Path, other: Path, chance: random.Random) -> None:
    """Damage a segment in one of the ways of disks, copies and people."""
    data = bytearray(segment.read_bytes())
    kind, place = chance.randrange(6), chance.randrange(len(data))
    if kind == 0:
        data[place] ^= 1 << chance.randrange(8)
    elif kind == 1:
        del data[place:]
    elif kind == 2:
        data[place : place + chance.randrange(1, 200)] = bytes(chance.randrange(1, 200))
    elif kind == 3:
        data = bytearray(other.read_bytes())
        other.write_bytes(segment.read_bytes())
    elif kind == 4:
        rest = other.read_bytes()
        data = data[:place] + rest[min(place, len(rest)) :]
    else:  # the two halves exchanged
        data = data[place:] + data[:place]
    segment.write_bytes(data)


def test_damage_is_never_believed() -> None:
    """After each of 100 kinds of damage, a search gives the stored run or nothing, and no error."""
    runs = runs_by_key(range(12))
    items = list(runs.items())
    store_finished_runs(items[:6])
    store_finished_runs(items[6:])
    first, second = segments()
    intact, lost = (first.read_bytes(), second.read_bytes()), 0
    for seed in range(100):
        damage(first, second, random.Random(seed))
        matches = {key: find(key) for key in runs}
        assert {key: run for key, run in matches.items() if run} == {k: runs[k] for k in runs if matches[k]}
        lost += sum(run is None for run in matches.values())
        first.write_bytes(intact[0])
        second.write_bytes(intact[1])
    assert lost > 100


@pytest.mark.parametrize("kind", ["folder", "pipe", "link", "empty", "name"])
def test_what_is_no_segment_is_ignored(kind: str, tmp_path: Path) -> None:
    store_finished_runs(runs_by_key(range(2)).items())
    path = finished_runs_folder() / "x.runs"
    if kind == "folder":
        path.mkdir()
    elif kind == "pipe":
        os.mkfifo(path)
    elif kind == "link":
        path.symlink_to(tmp_path / "nowhere")
    elif kind == "name":
        (path.parent / "x\n.runs").touch()
    else:
        path.touch()
    assert {key: find(key) for key in runs_by_key(range(2))} == runs_by_key(range(2))


def test_two_commands_that_fill_the_store_at_once_lose_nothing() -> None:
    processes = [
        get_context("fork").Process(
            target=lambda i=i: [store_finished_runs([item]) for item in runs_by_key(range(i, 60, 2)).items()]
        )
        for i in range(2)
    ]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    assert {key: find(key) for key in runs_by_key(range(60))} == runs_by_key(range(60))


def test_the_least_recently_used_segments_are_pruned(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each search that succeeds marks its segment as used; large stores consist of several segments."""
    monkeypatch.setattr(finished_run_store, "_MOST_SEGMENT_BYTES", 1)
    runs = list(runs_by_key(range(3)).items())
    store_finished_runs(runs)
    for path in segments():
        os.utime(path, (1000, 1000))
    assert len(segments()) == 3
    assert find(runs[1][0])
    size = sum(path.stat().st_blocks * 512 for path in segments()) // 3
    monkeypatch.setattr(cache_layout_and_pruning, "MOST_FINISHED_RUNS_BYTES", size)
    store_finished_runs([])
    assert [key for key, _ in runs if find(key)] == [runs[1][0]]


def test_forgetting_a_run_takes_its_segment() -> None:
    keys = list(runs_by_key(range(4)))
    items = list(runs_by_key(range(4)).items())
    store_finished_runs(items[:2])
    store_finished_runs(items[2:])
    FinishedRuns().forget(keys[0])
    assert [find(key) is not None for key in keys] == [False, False, True, True]


def test_a_cache_that_cannot_be_written_is_ignored(tmp_path: Path) -> None:
    finished_runs_folder().parent.mkdir(parents=True)
    finished_runs_folder().touch()
    (key, run), *_ = runs_by_key(range(1)).items()
    store_finished_runs([(key, run)])
    unproved = UnprovedRuns(tmp_path, "plan", "0001-w0")
    unproved.append(key, run)
    unproved.close()
    assert (find(key), list(unproved)) == (None, [])


def test_runs_without_proof_are_no_part_of_the_store(tmp_path: Path) -> None:
    """They belong to their run folder and plan, and a killed command leaves all but the last one."""
    runs = list(runs_by_key(range(3)).items())
    unproved = UnprovedRuns(tmp_path, "plan", "0001-w0")
    for key, run in runs:
        unproved.append(key, run)
    unproved.close()
    assert find(runs[0][0]) is None
    assert list(UnprovedRuns(tmp_path, "plan")) == runs
    assert list(UnprovedRuns(tmp_path, "another plan")) == []
    (path,) = (path for path in finished_runs_folder().rglob("0001-w0*"))
    path.write_bytes(path.read_bytes()[:-1])
    assert list(UnprovedRuns(tmp_path, "plan")) == runs[:2]
    unproved.delete()
    assert list(UnprovedRuns(tmp_path, "plan")) == []
