"""Trees of runs: what changes in one is noticed, and never in the next."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

from mutator.engines import pyc_files
from mutator.engines.job_tree import JobTree
from mutator.engines.job_tree_pool import JobTreePool
from mutator.targets.source_tree import read_tree

CODE = "__pycache__/go.pyc"
CHANGED = {"car/go.py": b"stop = 1", "car/_fi.py": b"probe = 1"}


@pytest.fixture
def base(tmp_path: Path) -> JobTreePool:
    (tmp_path / "root" / "car" / "parts").mkdir(parents=True)
    for name in ("go", "wheel", "parts/door"):
        (tmp_path / "root" / "car" / f"{name}.py").write_bytes(b"from car import wheel")
    (tmp_path / "root" / "car" / "data.npz").write_bytes(b"data")
    return JobTreePool(read_tree(tmp_path / "root", ["**/*"]), tmp_path, "car.go")


def content(tree: JobTree) -> dict[str, bytes]:
    paths = (path for path in tree.folder.rglob("*") if path.is_file())
    return {str(path.relative_to(tree.folder)): path.read_bytes() for path in paths}


def write_and_put_back(path: Path) -> None:
    """As a mutant would that wants to stay unnoticed."""
    state, data = path.stat(), path.read_bytes()
    path.write_bytes(data[::-1])
    path.write_bytes(data)
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def exchange(path: Path) -> None:
    state, data = path.stat(), path.read_bytes()
    path.write_bytes(data[::-1])
    os.utime(path, ns=(state.st_atime_ns, state.st_mtime_ns))


def write_through_a_link(path: Path) -> None:
    os.link(path, path.parents[2] / "link")
    exchange(path.parents[2] / "link")
    (path.parents[2] / "link").unlink()


def replace_its_folder(path: Path) -> None:
    path.parent.rename(path.parents[2] / "aside")
    path.parent.symlink_to(path.parents[2] / "aside")


CHANGES = (write_and_put_back, exchange, write_through_a_link, replace_its_folder, Path.unlink, Path.touch)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", ["go.py", "wheel.py", "data.npz", "__pycache__/wheel.{}.pyc"])
def test_a_change_is_noticed(
    base: JobTreePool, tmp_path: Path, change: Callable[[Path], None], name: str
) -> None:
    tree = base.lay_out_tree(tmp_path / "run" / "tree", CHANGED)
    assert not tree.first_changed_path()
    (path,) = (tree.folder / "car").glob(name.format("*"))
    change(path)
    assert tree.first_changed_path().startswith("car")


def test_a_file_that_an_import_finds_first_is_noticed(base: JobTreePool, tmp_path: Path) -> None:
    for name in (
        "json.py",
        "car/wheel.abi3.so",
        "car/__pycache__/go.cpython-311.pyc",
        "car/wheel/__init__.py",
    ):
        tree = base.lay_out_tree(tmp_path / "run" / "tree", CHANGED)
        (tree.folder / name).parent.mkdir(exist_ok=True)
        (tree.folder / name).write_bytes(b"")
        assert tree.first_changed_path() == name
        tree.folder.rename(tmp_path / str(len(list(tmp_path.iterdir()))))


def test_an_unchanged_tree_is_used_again_and_has_nothing_of_an_earlier_mutant(
    base: JobTreePool, tmp_path: Path
) -> None:
    tree = base.lay_out_tree(tmp_path / "a" / "tree", CHANGED)
    first = {**content(tree)}
    number = (tree.folder / "car" / "wheel.py").stat().st_ino
    base.take_back_tree(tree)
    again = base.lay_out_tree(tmp_path / "b" / "tree", {})
    assert (again.folder / "car" / "wheel.py").stat().st_ino == number
    assert content(again) == content(base.lay_out_tree(tmp_path / "c" / "tree", {}))
    new = content(base.lay_out_tree(tmp_path / "d" / "tree", {}, fresh=True))
    assert new == {name: data for name, data in content(again).items() if not name.endswith(".pyc")}
    assert content(again).keys() == first.keys() - {"car/_fi.py"} | {
        name for name in content(again) if "go.cpython" in name
    }
    base.take_back_tree(again)
    base.close()
    assert not [path for path in tmp_path.iterdir() if "-tree-" in path.name]


def test_a_tree_with_new_files_is_not_used_again(base: JobTreePool, tmp_path: Path) -> None:
    tree = base.lay_out_tree(tmp_path / "a" / "tree", CHANGED)
    (tree.folder / "car" / "left.json").touch()
    assert not tree.first_changed_path()
    base.take_back_tree(tree)
    assert tree.folder.is_dir()
    assert "car/left.json" not in content(base.lay_out_tree(tmp_path / "b" / "tree", CHANGED))


@pytest.mark.parametrize("within", ["", "car"])
@pytest.mark.parametrize("change", [Path.touch, Path.mkdir, "link", "nothing"])
def test_what_stands_in_the_place_of_an_unused_tree_is_not_used(
    base: JobTreePool, tmp_path: Path, within: str, change: Callable[[Path], None] | str
) -> None:
    """A run can delete an unused tree, or put a file or a link there. Nothing is written through the link."""
    right = content(base.lay_out_tree(tmp_path / "right" / "tree", CHANGED))
    tree = base.lay_out_tree(tmp_path / "a" / "tree", CHANGED)
    base.take_back_tree(tree)
    (unused,) = tmp_path.glob("*-tree-*")
    (unused / within).rename(tmp_path / "aside")
    if change == "link":
        (unused / within).symlink_to(tmp_path / "aside")
    elif not isinstance(change, str):
        change(unused / within)
    before = {path: path.read_bytes() for path in (tmp_path / "aside").rglob("*.py")}
    again = base.lay_out_tree(tmp_path / "b" / "tree", CHANGED)
    assert not again.first_changed_path()
    assert content(again) == right
    assert before == {path: path.read_bytes() for path in (tmp_path / "aside").rglob("*.py")}


def test_only_what_a_run_imports_is_compiled_once_and_when_the_first_tree_needs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, base: JobTreePool
) -> None:
    compiled: list[str] = []

    def compile_and_note(data: bytes, name: str, *rest: object, **flags: Any) -> object:
        compiled.append(name)
        return compile(data, name, *rest, **flags)  # type: ignore[call-overload]

    monkeypatch.setattr(pyc_files, "compile", compile_and_note, raising=False)
    base.lay_out_tree(tmp_path / "fresh" / "tree", CHANGED, fresh=True)
    assert not compiled
    with ThreadPoolExecutor(4) as pool:
        trees = list(pool.map(lambda i: base.lay_out_tree(tmp_path / f"{i}" / "tree", {}), range(4)))
    assert sorted(compiled) == ["car/go.py", "car/wheel.py"]
    pristine = content(trees[0])
    assert {"car/parts/door.py", pyc_files.bytecode_path("car/wheel.py")} < pristine.keys()
    assert pyc_files.bytecode_path("car/parts/door.py") not in pristine
