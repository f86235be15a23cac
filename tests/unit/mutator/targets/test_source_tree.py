"""The files of a target in memory, and values that are derived from them."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.source_tree import read_tree


def test_derived_once(tmp_path: Path) -> None:
    """A derived value is computed once for each path and function, from the file as it was read."""
    (tmp_path / "a.py").write_text("a = 1\n")
    (tmp_path / "b.py").write_text("b = 1\n")
    tree = read_tree(tmp_path, ["*.py"])
    (tmp_path / "a.py").write_text("changed\n")
    calls = []

    def size(path: str, data: bytes, root: Path) -> int:
        calls.append((path, data, root))
        return len(data)

    def name(path: str, data: bytes, root: Path) -> str:
        return path

    assert [tree.derived(path, size) for path in ("a.py", "b.py", "a.py")] == [6, 6, 6]
    assert calls == [("a.py", b"a = 1\n", tmp_path), ("b.py", b"b = 1\n", tmp_path)]
    assert tree.derived("a.py", name) == "a.py"


def test_a_file_that_the_target_lacks(tmp_path: Path) -> None:
    """If a path is not one of the manifest's files, the error names it, and nothing is derived."""
    (tmp_path / "a.txt").write_text("a")
    tree = read_tree(tmp_path, ["*.py"])
    with pytest.raises(MutatorError, match=r"no file 'a\.txt' in the target"):
        tree.derived("a.txt", lambda *_: pytest.fail("made"))
