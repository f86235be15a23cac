"""The survey of a source tree, which reads the tree and never imports it."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.onboarding.survey import look_at

Tree = Callable[..., Path]


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    """Write files below a folder, given as path and text."""

    def write(**files: str) -> Path:
        for name, text in files.items():
            path = tmp_path / "tree" / name.replace("__", "/").replace("_py", ".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path / "tree"

    (tmp_path / "tree").mkdir()
    return write


def test_packages_and_flat_modules(tree: Tree) -> None:
    """Packages and flat modules are distinguished. Tests, setup scripts and folders without Python are
    ignored."""
    folder = tree(
        pkg__a_py="",
        loose_py="",
        setup_py="",
        test_loose_py="",
        tests__x_py="",
        data__notes="",
        build__y_py="",
    )
    found = look_at(str(folder))
    assert found.root == folder
    assert found.packages == ("loose.py", "pkg")
    assert [module.name for module in found.modules] == ["loose", "pkg.a"]


def test_a_package_itself(tree: Tree) -> None:
    """If the folder of a package is given, the root is the folder above it."""
    folder = tree(pkg__a_py="x = 1\n")
    (folder / "pkg" / "__init__.py").touch()
    found = look_at(str(folder / "pkg"))
    assert (found.root, found.packages) == (folder, ("pkg",))
    assert [module.name for module in found.modules] == ["pkg", "pkg.a"]


def test_a_src_layout(tree: Tree) -> None:
    """The root of a project with its package in src/ is that folder."""
    folder = tree(src__pkg__a_py="", setup_py="")
    found = look_at(str(folder))
    assert (found.root, found.packages) == (folder / "src", ("pkg",))


def test_an_empty_folder(tree: Tree) -> None:
    assert look_at(str(tree())).packages == ()


def test_what_cannot_be_read_is_told(tree: Tree) -> None:
    """A file with a syntax error, or one that is not text, is left out and listed with position and
    reason."""
    folder = tree(bad_py="x = 1\ndef (:\n", good_py="")
    (folder / "binary.py").write_bytes(b"\0\xff")
    found = look_at(str(folder))
    assert [module.path for module in found.modules] == ["good.py"]
    assert [place for place, _ in found.unread] == ["bad.py:2", "binary.py:1"]
    assert all(why for _, why in found.unread)


def test_nothing_is_imported(tree: Tree) -> None:
    tree(harm_py="raise SystemExit('imported')\n")
    assert look_at(str(tree())).packages == ("harm.py",)
    assert "harm" not in sys.modules


def test_what_cannot_be_imported_is_no_module(tree: Tree) -> None:
    """Pipes, dangling links and files whose names are not module names are left out."""
    folder = tree(pkg__a_py="")
    for name in ("b-c.py", "class.py"):
        (folder / "pkg" / name).touch()
    os.mkfifo(folder / "pkg" / "pipe.py")
    (folder / "gone.py").symlink_to(folder / "nowhere")
    found = look_at(str(folder))
    assert found.packages == ("pkg",)
    assert [module.path for module in found.modules] == ["pkg/a.py"]


def test_its_warnings_are_its_own(tree: Tree, recwarn: pytest.WarningsRecorder) -> None:
    """Python's warnings about the controller's code are not shown."""
    look_at(str(tree(odd_py="x = '\\d'\ny = 1 is 1\n")))
    assert not recwarn.list


def test_environments_and_hidden_folders_are_no_source(tree: Tree) -> None:
    """Hidden folders, and virtual environments of any name below a package, are left out."""
    folder = tree(pkg__a_py="", pkg__own__lib_py="")
    (folder / "pkg" / "own" / "pyvenv.cfg").touch()
    (folder / "pkg" / ".hidden").mkdir()
    (folder / "pkg" / ".hidden" / "b.py").touch()
    assert [module.path for module in look_at(str(folder)).modules] == ["pkg/a.py"]


def test_an_installed_package() -> None:
    """`installed:NAME` finds a package without importing it, and adds its requirement."""
    found = look_at("installed:typer")
    assert found.packages == ("typer",)
    assert found.requires and found.requires.startswith("typer>=")
    assert any(module.name == "typer.main" for module in found.modules)


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("/nowhere/at/all", "no folder"),
        ("installed:nowhere_at_all", "no installed package 'nowhere_at_all'"),
        ("installed:../x", "no installed package"),
        ("installed:math", "no installed package 'math'"),
    ],
)
def test_what_is_not_there_is_told(target: str, words: str) -> None:
    """A missing folder or package, or one without Python source, is reported as a user's error with a
    remedy."""
    with pytest.raises(MutatorError, match=words) as told:
        look_at(target)
    assert told.value.remedy
