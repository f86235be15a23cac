"""The files of a target in memory."""

from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.targets.source_tree import SourceTree, read_tree


def test_a_value_is_derived_once_for_each_path_and_function(tmp_path: Path) -> None:
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

    assert [tree.derive_once(path, size) for path in ("a.py", "b.py", "a.py")] == [6, 6, 6]
    assert calls == [("a.py", b"a = 1\n", tmp_path), ("b.py", b"b = 1\n", tmp_path)]
    assert tree.derive_once("a.py", name) == "a.py"


def test_a_value_of_all_files_is_derived_once(tmp_path: Path) -> None:
    """Facts that need every file cost one pass for each target, however many places ask for them."""
    (tmp_path / "a.py").write_text("a = 1\n")
    tree = read_tree(tmp_path, ["*.py"])
    calls = []

    def paths(tree: SourceTree) -> list[str]:
        calls.append(tree)
        return list(tree.files)

    assert [tree.derive_once_from_all(paths) for _ in range(2)] == [["a.py"], ["a.py"]]
    assert calls == [tree]


def test_an_unknown_path_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("a")
    tree = read_tree(tmp_path, ["*.py"])
    with pytest.raises(MutatorError, match=r"no file 'a\.txt' in the target"):
        tree.derive_once("a.txt", lambda *_: pytest.fail("the value was derived"))
