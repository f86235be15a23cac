"""Checksummed lines."""

import errno
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import DiskFull, MutatorError
from mutator.store.checksummed_lines import LineWriter, Segment, read_segment

SCHEMA = "records/2"
HEAD = {"schema": SCHEMA, "plan": "p"}


def write(path: Path, *values: object) -> Path:
    writer = LineWriter(path, HEAD)
    for value in values:
        writer.append({"value": value})
    writer.close()
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write(tmp_path / "records" / "0001-gw0.jsonl", *range(6))


def values(segment: Segment) -> list[object]:
    return [line["value"] for _, line in segment.numbered_objects(SCHEMA)]


def test_lines_are_read_as_appended(tmp_path: Path) -> None:
    given = [1.5, float("inf"), None, 'ü\n"sum"', {"sum": "0" * 16}, [[], {}]]
    segment = read_segment(write(tmp_path / "records" / "a.jsonl", *given))
    assert values(segment) == given
    assert [number for number, _ in segment.numbered_objects(SCHEMA)] == [2, 3, 4, 5, 6, 7]
    assert (segment.damaged_line_numbers, segment.complete_lines_end) == ((), segment.path.stat().st_size)


def test_every_line_is_json_that_begins_with_its_checksum(path: Path) -> None:
    for line in path.read_text().splitlines():
        assert next(iter(json.loads(line))) == "sum" and len(json.loads(line)["sum"]) == 16


@pytest.mark.parametrize("bit", range(8))
def test_a_flipped_bit_is_reported_with_its_line(path: Path, bit: int) -> None:
    """A flipped bit in the last byte makes the last line incomplete."""
    data = path.read_bytes()
    for place in range(len(data)):
        path.write_bytes(data[:place] + bytes([data[place] ^ 1 << bit]) + data[place + 1 :])
        line = data[:place].count(b"\n") + 1
        segment = read_segment(path)
        if place == len(data) - 1:
            assert (values(segment), segment.complete_lines_end < len(data)) == ([0, 1, 2, 3, 4], True)
        else:
            assert segment.damaged_line_numbers[0] == line


CHANGES: dict[str, tuple[Callable[[list[bytes]], list[bytes]], tuple[int, ...]]] = {
    "dropped": (lambda x: [*x[:2], *x[3:]], (3,)),
    "doubled": (lambda x: [*x[:3], *x[2:]], (4,)),
    "swapped": (lambda x: [*x[:2], x[3], x[2], *x[4:]], (3, 4, 5)),
    "emptied": (lambda x: [*x[:2], b"\n", *x[3:]], (3, 4)),
    "zeroed": (lambda x: [*x[:2], b"\0" * len(x[2]), *x[3:]], (3, 4)),
    "without head": (lambda x: x[1:], (1,)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_only_damaged_lines_are_lost(path: Path, change: str) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    make, damaged = CHANGES[change]
    path.write_bytes(b"".join(make(lines)))
    segment = read_segment(path)
    assert segment.damaged_line_numbers == damaged
    with pytest.raises(MutatorError, match=rf"0001-gw0\.jsonl:{damaged[0]}: a damaged line; .* --repair"):
        values(segment)


@pytest.mark.parametrize("keep", [1, 20, -1, -2])
def test_an_incomplete_last_line_is_not_damage(path: Path, keep: int) -> None:
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(b"".join(lines[:-1]) + lines[-1][:keep])
    segment = read_segment(path)
    assert values(segment) == [0, 1, 2, 3, 4] and segment.complete_lines_end == len(b"".join(lines[:-1]))


def test_a_renamed_file_is_reported(path: Path) -> None:
    """A file contains its own name."""
    moved = path.rename(path.with_name("0002-gw0.jsonl"))
    with pytest.raises(MutatorError, match=r"0002-gw0\.jsonl:1: was written as records/0001-gw0\.jsonl"):
        values(read_segment(moved))


@pytest.mark.parametrize("written", [0, 20])
def test_a_line_that_a_full_disk_cut_off_is_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, written: int
) -> None:
    writer = LineWriter(tmp_path / "records" / "a.jsonl", HEAD)
    writer.append({"value": 1})
    real, calls = os.write, []

    def full(fd: int, data: bytes) -> int:
        calls.append(len(data))
        if written and len(calls) == 1:
            return real(fd, data[:written])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(os, "write", full)
        with pytest.raises(DiskFull):
            writer.append({"value": 2})
    writer.append({"value": 3})
    writer.close()
    assert values(read_segment(writer.path)) == [1, 3]


def test_a_full_disk_on_sync_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file system with late allocation can report a full disk only when it syncs. The record can still be
    read."""
    writer = LineWriter(tmp_path / "records" / "a.jsonl", HEAD)
    writer.append({"value": 1})

    def full(fd: int) -> None:
        raise OSError(errno.EDQUOT, "Quota exceeded")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(DiskFull):
        writer.close()
    assert values(read_segment(writer.path)) == [1]


def test_records_are_synced_in_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    synced = []
    monkeypatch.setattr(os, "fsync", synced.append)
    write(tmp_path / "a.jsonl", *range(100))
    assert 3 <= len(synced) <= 6


def test_an_existing_file_is_not_reopened(tmp_path: Path) -> None:
    LineWriter(tmp_path / "a.jsonl", HEAD).close()
    with pytest.raises(FileExistsError):
        LineWriter(tmp_path / "a.jsonl", HEAD)


def test_a_folder_or_pipe_is_refused_as_a_segment(tmp_path: Path) -> None:
    """Opening a pipe would wait for a writer."""
    os.mkfifo(tmp_path / "pipe.jsonl")
    (tmp_path / "folder.jsonl").mkdir()
    for name in ("pipe.jsonl", "folder.jsonl"):
        with pytest.raises(MutatorError, match="no file"):
            read_segment(tmp_path / name)
