"""No source tree takes long or much memory."""

from itertools import pairwise
from pathlib import Path

import pytest

from mutator.mutants.parsed_files_and_anchors import parse_file
from mutator.targets.source_tree import MOST_SOURCE_BYTES, read_tree
from tests.costs import is_cheap, is_refused

SOURCES = {
    "brackets": "x = " + "(" * 100_000 + ")" * 100_000,
    "signs": "x = " + "-" * 100_000 + "1",
    "some signs": "x = " + "-" * 900 + "1",
    "a sum": "x = 1" + "+1" * 900,
    "attributes": "x = a" + ".a" * 900,
    "alternatives": "x = a" + " or a" * 50_000,
    "a dotted name": "import a" + ".a" * 10_000,
    "a module": "from a" + ".a" * 10_000 + " import b",
    "branches": "if a: pass\n" + "elif a: pass\n" * 10_000,
    "statements": "x\n" * 75_000,
    "a list": "x = [" + "1," * 200_000 + "]",
    "texts": "x = " + "'a' " * 5000,
    "a null character": "x\0",
    "another encoding": "# coding: rot13\nx",
}


@pytest.mark.parametrize("source", SOURCES.values(), ids=SOURCES)
def test_a_hostile_source_file_ends_soon(source: str) -> None:
    is_cheap(lambda: parse_file("a.py", f"{source}\n".encode(), Path("/tree")))


def test_large_files_and_many_folders_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_bytes(b"#" * (MOST_SOURCE_BYTES + 1))
    assert "at most 1,000,000 bytes" in is_refused(lambda: read_tree(tmp_path, ("**",)))
    (tmp_path / "a.py").unlink()
    with (tmp_path / "model.bin").open("wb") as file:
        file.truncate(4 * 10**12)
    assert "model.bin: 4,000,000,000,000 bytes" in is_refused(lambda: read_tree(tmp_path, ("**",)))


def test_links_that_multiply_folders_are_counted(tmp_path: Path) -> None:
    """Each folder has two links to the next, so that 18 folders have a quarter of a million paths."""
    # Linux follows 40 links of a path, and counts those of an attempt that it repeats twice
    folders = [tmp_path / f"d{i}" for i in range(18)]
    for folder, following in pairwise(folders):
        folder.mkdir()
        for name in "ab":
            (folder / name).symlink_to(following)
    folders[-1].mkdir()
    assert "more than 50,000 files and folders" in is_refused(lambda: read_tree(tmp_path, ("**",)))
