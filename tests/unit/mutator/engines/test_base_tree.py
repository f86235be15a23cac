"""The pristine tree, which runs share through links."""

from pathlib import Path

import pytest

from mutator.engines.base_tree import BaseTree


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "base"
    (folder / "car" / "__pycache__").mkdir(parents=True)
    (folder / "car" / "go.py").write_bytes(b"go")
    (folder / "car" / "__pycache__" / "go.pyc").write_bytes(b"bytecode")
    return folder


def test_writes_to_a_tree_without_links_stay_in_it(folder: Path, tmp_path: Path) -> None:
    base = BaseTree(folder)
    base.lay_out(tmp_path / "tree", linked=False)
    (tmp_path / "tree" / "car" / "go.py").write_bytes(b"stop")
    assert (tmp_path / "tree" / "car" / "__pycache__" / "go.pyc").read_bytes() == b"bytecode"
    assert not base.was_changed()


@pytest.mark.parametrize("name", ["car/go.py", "car/__pycache__/go.pyc"])
def test_writes_through_a_link_are_undone(folder: Path, tmp_path: Path, name: str) -> None:
    """`was_changed` reports a change once to each user of the tree."""
    base, other = BaseTree(folder), BaseTree(folder)
    genuine = (folder / name).read_bytes()
    base.lay_out(tmp_path / "tree", linked=True)
    (tmp_path / "tree" / name).write_bytes(b"stop")
    assert [base.was_changed(), base.was_changed()] == [True, False]
    assert (folder / name).read_bytes() == genuine
    assert [other.was_changed(), other.was_changed(), base.was_changed()] == [True, False, False]
    (folder / name).chmod(0)
    assert base.was_changed()
    assert (folder / name).stat().st_mode & 0o400
    assert [path.name for path in tmp_path.iterdir()].count("base") == len(list(tmp_path.glob("base*"))) == 1
