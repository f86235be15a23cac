"""Files of lines are followed while they grow."""

from pathlib import Path

import pytest

from mutator.store.checksummed_lines import LineWriter
from mutator.store.line_tail import LineTail


def numbers(tail: LineTail, most_bytes: int | None = None) -> list[bytes]:
    """The ends of the new lines, without heads."""
    return [line[26:] for line in tail.read_new_lines(most_bytes) if b"schema" not in line]


@pytest.fixture
def writer(tmp_path: Path) -> LineWriter:
    return LineWriter(tmp_path / "records" / "0001-a.jsonl", {"schema": "records/2"})


def test_each_line_is_read_once(writer: LineWriter, tmp_path: Path) -> None:
    tail = LineTail(tmp_path, "records")
    writer.append({"n": 1})
    assert numbers(tail) == [b'"n":1}']
    assert numbers(tail) == []
    writer.append({"n": 2})
    other = LineWriter(tmp_path / "records" / "0001-b.jsonl", {"schema": "records/2"})
    other.append({"n": 3})
    assert numbers(tail) == [b'"n":2}', b'"n":3}']


def test_a_line_that_is_being_written_waits_until_it_is_complete(writer: LineWriter, tmp_path: Path) -> None:
    writer.append({"n": 1})
    whole = writer.path.read_bytes()
    tail = LineTail(tmp_path, "records")
    writer.path.write_bytes(whole[:-3])
    assert numbers(tail) == []
    writer.path.write_bytes(whole)
    assert numbers(tail) == [b'"n":1}']


def test_a_line_that_does_not_match_its_checksum_is_left_out(writer: LineWriter, tmp_path: Path) -> None:
    for n in (1, 2, 3):
        writer.append({"n": n})
    writer.path.write_bytes(writer.path.read_bytes().replace(b'"n":2', b'"n":7'))
    assert numbers(LineTail(tmp_path, "records")) == [b'"n":1}', b'"n":3}']


def test_a_call_reads_a_bounded_part_and_says_that_there_is_more(writer: LineWriter, tmp_path: Path) -> None:
    for n in range(20):
        writer.append({"n": n})
    tail, parts = LineTail(tmp_path, "records"), []
    while not parts or tail.has_more:
        parts.append(numbers(tail, 200))
    assert len(parts) > 3
    assert [line for part in parts for line in part] == [b'"n":%d}' % n for n in range(20)]


def test_a_link_is_not_followed(writer: LineWriter, tmp_path: Path) -> None:
    writer.append({"n": 1})
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "a.jsonl").symlink_to(writer.path)
    assert numbers(LineTail(tmp_path, "other")) == []
