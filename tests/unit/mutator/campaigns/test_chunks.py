"""Chunks: how a plan is divided, and which experiments remain to run."""

from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.campaigns.chunks import PendingChunk, chunk_lengths, pending_chunks_of
from mutator.campaigns.plan import build_plan
from mutator.campaigns.plan_freezing import freeze_plan
from mutator.model import Record, Status
from mutator.store.plan_file import load_chunk, load_faults
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace


@pytest.mark.parametrize(
    ("groups", "size", "lengths"),
    [
        ("aaaaa", 2, (2, 2, 1)),
        ("aaabbb", 2, (2, 1, 2, 1)),
        ("abab", 9, (1, 1, 1, 1)),
        ("aaa", 9, (3,)),
        ("", 3, ()),
    ],
)
def test_a_plan_is_divided_into_chunks(groups: str, size: int, lengths: tuple[int, ...]) -> None:
    assert chunk_lengths(groups, size) == lengths


@pytest.fixture
def folder(toycar: Workspace, tmp_path: Path) -> RunFolder:
    return freeze_plan(build_plan(toycar, "toy"), tmp_path / "run", toycar)


def test_all_experiments_are_pending_at_first(folder: RunFolder) -> None:
    left = pending_chunks_of(folder, {})
    assert [item.chunk_index for item in left] == list(range(8))
    assert sum(len(item.pending_positions) for item in left) == 24


def test_experiments_without_a_valid_record_are_pending(
    folder: RunFolder, record: Callable[..., Record]
) -> None:
    faults = load_faults(folder.path)
    chunks = [load_chunk(folder.path, chunk, faults) for chunk in folder.head.chunks]
    records = {e.id: record(e.id) for e in (*chunks[0], chunks[1][1], chunks[2][0])}
    wrong = record(chunks[2][0].id, status=Status.HARNESS_ERROR, outcome=None)
    records[wrong.experiment_id] = wrong
    left = pending_chunks_of(folder, records)
    assert left[0] == PendingChunk(1, (0, 2))
    assert left[1] == PendingChunk(2, (0, 1, 2))
    assert len(left) == 7


def test_the_chunks_together_contain_the_whole_plan(folder: RunFolder) -> None:
    faults = load_faults(folder.path)
    found = [e.id for chunk in folder.head.chunks for e in load_chunk(folder.path, chunk, faults)]
    assert len(found) == len(set(found)) == 24
    assert folder.experiment_id_from(found[5][:10]) == found[5]
