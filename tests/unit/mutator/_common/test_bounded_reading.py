"""Readers with limits."""

import gzip
import os
import zlib
from pathlib import Path

import pytest

from mutator._common.bounded_reading import decompress_bounded, open_regular, read_bounded, read_bounded_lines
from mutator._common.files import is_no_file_error
from mutator.errors import TooLarge

TERABYTES = 4 * 10**12


def sparse(path: Path, size: int = TERABYTES) -> Path:
    with path.open("wb") as file:
        file.truncate(size)
    return path


def test_a_file_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"12345")
    assert read_bounded(path, 5) == b"12345"
    with pytest.raises(TooLarge, match=r"file: 5 bytes; expected at most 4 bytes; "):
        read_bounded(path, 4)


def test_a_sparse_file_is_refused_for_its_size_and_for_its_holes(tmp_path: Path) -> None:
    with pytest.raises(TooLarge, match=r"4,000,000,000,000 bytes; "):
        read_bounded(sparse(tmp_path / "file"))
    with pytest.raises(TooLarge, match=r"100,000,000 bytes with holes; "):
        read_bounded(sparse(tmp_path / "file", 100_000_000), 200_000_000)


def test_a_file_that_grows_is_not_read_further() -> None:
    with Path("/proc/self/maps").open("rb") as file, pytest.raises(TooLarge):
        list(read_bounded_lines(file, Path("maps"), 1))  # its size is 0
    assert len(read_bounded(Path("/proc/self/maps"))) > 1


@pytest.mark.parametrize("path", ["/dev/zero", "/dev", "pipe", "link"])
def test_what_is_no_regular_file_is_not_opened(tmp_path: Path, path: str) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    with pytest.raises(OSError, match=r"such device|directory") as caught:
        open_regular(tmp_path / path)
    assert is_no_file_error(caught.value)


def test_lines_have_a_longest_length(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    path.write_bytes(b"ab\ncd\nefg\n")
    with path.open("rb") as file:
        assert list(read_bounded_lines(file, path, 4)) == [b"ab\n", b"cd\n", b"efg\n"]
    with path.open("rb") as file, pytest.raises(TooLarge, match=r"lines:3: a line of more than 3 bytes"):
        list(read_bounded_lines(file, path, 3))


def test_data_is_unpacked_up_to_its_limit() -> None:
    data = bytes(1000)
    assert decompress_bounded(zlib.compress(data), 1000) == data
    assert decompress_bounded(gzip.compress(data), 1000, gzip=True) == data
    with pytest.raises(ValueError, match="more than 999 bytes"):
        decompress_bounded(zlib.compress(data), 999)
    for damaged in (b"", b"x", zlib.compress(data)[:-1]):
        with pytest.raises(zlib.error):
            decompress_bounded(damaged, 1000)
    with pytest.raises(zlib.error):
        decompress_bounded(gzip.compress(data) + b"x", 1000, gzip=True)
