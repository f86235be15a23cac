"""Files that consist of checksummed blocks."""

from pathlib import Path

import pytest

from mutator.store.checksummed_blocks import BlockWriter, block_bytes, read_blocks

CONTENT = {"one": b"1" * 50, "two": b"FIB1" * 9, "three": b""}


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "some.blocks"
    writer = BlockWriter(path)
    for kind, (key, data) in enumerate(CONTENT.items()):
        writer.append(kind, key, data)
    writer.close()
    return path


def keys(path: Path) -> list[str]:
    return [block.key for block in read_blocks(path).blocks]


def test_blocks_are_read_in_order(file: Path) -> None:
    found = read_blocks(file)
    assert [(one.kind, one.key, one.data) for one in found.blocks] == [
        (kind, key, data) for kind, (key, data) in enumerate(CONTENT.items())
    ]
    data = file.read_bytes()
    assert all(data[one.offset : one.offset + len(one.data)] == one.data for one in found.blocks)
    assert not found.is_damaged


def test_a_truncated_last_block_is_unfinished_and_not_damaged(file: Path) -> None:
    whole = file.read_bytes()
    for length in range(len(whole) - len(block_bytes(2, "three", b"")), len(whole)):
        file.write_bytes(whole[:length])
        assert keys(file) == ["one", "two"]
        assert not read_blocks(file).is_damaged


def test_a_changed_byte_damages_only_its_block(file: Path) -> None:
    whole = file.read_bytes()
    second = len(block_bytes(0, "one", CONTENT["one"]))
    for place in range(second, second + len(block_bytes(1, "two", CONTENT["two"]))):
        file.write_bytes(whole[:place] + bytes([whole[place] ^ 0x55]) + whole[place + 1 :])
        assert keys(file) == ["one", "three"]
        assert read_blocks(file).is_damaged


def test_a_file_cannot_be_opened_by_two_writers(file: Path) -> None:
    with pytest.raises(FileExistsError):
        BlockWriter(file)
