"""The survey of a source tree, which reads the tree and never imports it."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.errors import MutatorError
from mutator.onboarding.source_survey import survey_source

Tree = Callable[..., Path]


@pytest.fixture
def tree(tmp_path: Path) -> Tree:
    def write(**files: str) -> Path:
        for name, text in files.items():
            path = tmp_path / "tree" / name.replace("__", "/").replace("_py", ".py")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path / "tree"

    (tmp_path / "tree").mkdir()
    return write


def test_packages_and_flat_modules_are_distinguished(tree: Tree) -> None:
    folder = tree(
        pkg__a_py="",
        loose_py="",
        setup_py="",
        test_loose_py="",
        tests__x_py="",
        data__notes="",
        build__y_py="",
    )
    found = survey_source(str(folder))
    assert found.root == folder
    assert found.packages == ("loose.py", "pkg")
    assert [module.name for module in found.modules] == ["loose", "pkg.a"]


def test_the_root_of_a_package_is_the_folder_above_it(tree: Tree) -> None:
    folder = tree(pkg__a_py="x = 1\n")
    (folder / "pkg" / "__init__.py").touch()
    found = survey_source(str(folder / "pkg"))
    assert (found.root, found.packages) == (folder, ("pkg",))
    assert [module.name for module in found.modules] == ["pkg", "pkg.a"]


def test_src_is_the_root_of_a_project_with_a_src_layout(tree: Tree) -> None:
    folder = tree(src__pkg__a_py="", setup_py="")
    found = survey_source(str(folder))
    assert (found.root, found.packages) == (folder / "src", ("pkg",))


def test_an_empty_folder_has_no_packages(tree: Tree) -> None:
    assert survey_source(str(tree())).packages == ()


def test_an_unreadable_file_is_listed_with_its_position(tree: Tree) -> None:
    folder = tree(bad_py="x = 1\ndef (:\n", good_py="")
    (folder / "binary.py").write_bytes(b"\0\xff")
    found = survey_source(str(folder))
    assert [module.path for module in found.modules] == ["good.py"]
    assert [place for place, _ in found.unreadable_files] == ["bad.py:2", "binary.py:1"]
    assert all(why for _, why in found.unreadable_files)


def test_the_survey_imports_nothing(tree: Tree) -> None:
    tree(harm_py="raise SystemExit('imported')\n")
    assert survey_source(str(tree())).packages == ("harm.py",)
    assert "harm" not in sys.modules


def test_files_that_cannot_be_imported_are_left_out(tree: Tree) -> None:
    folder = tree(pkg__a_py="")
    for name in ("b-c.py", "class.py"):
        (folder / "pkg" / name).touch()
    os.mkfifo(folder / "pkg" / "pipe.py")
    (folder / "gone.py").symlink_to(folder / "nowhere")
    found = survey_source(str(folder))
    assert found.packages == ("pkg",)
    assert [module.path for module in found.modules] == ["pkg/a.py"]


def test_warnings_about_the_controllers_code_are_not_shown(
    tree: Tree, recwarn: pytest.WarningsRecorder
) -> None:
    survey_source(str(tree(odd_py="x = '\\d'\ny = 1 is 1\n")))
    assert not recwarn.list


def test_environments_and_hidden_folders_are_left_out(tree: Tree) -> None:
    folder = tree(pkg__a_py="", pkg__own__lib_py="")
    (folder / "pkg" / "own" / "pyvenv.cfg").touch()
    (folder / "pkg" / ".hidden").mkdir()
    (folder / "pkg" / ".hidden" / "b.py").touch()
    assert [module.path for module in survey_source(str(folder)).modules] == ["pkg/a.py"]


def test_an_installed_package_is_found_without_importing_it() -> None:
    found = survey_source("installed:typer")
    assert found.packages == ("typer",)
    assert found.requirement and found.requirement.startswith("typer>=")
    assert any(module.name == "typer.main" for module in found.modules)


@pytest.mark.parametrize(
    ("target", "words"),
    [
        ("/nowhere/at/all", "no folder"),
        (__file__, "test_source_survey.py is a file"),
        ("installed:nowhere_at_all", "no installed package 'nowhere_at_all'"),
        ("installed:../x", "no installed package"),
        ("installed:math", "no installed package 'math'"),
    ],
)
def test_what_is_no_folder_or_package_is_an_error_with_a_remedy(target: str, words: str) -> None:
    with pytest.raises(MutatorError, match=words) as told:
        survey_source(target)
    assert told.value.remedy


def test_a_link_out_of_the_tree_is_not_read(tree: Tree, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("class MySecret:\n    def update(self, state): ...\n")
    folder = tree(own_py="")
    (folder / "linked.py").symlink_to(tmp_path / "mine.py")
    found = survey_source(str(folder))
    assert [module.path for module in found.modules] == ["own.py"]
    assert found.unreadable_files == (("linked.py:1", "a link that leads out of its folder"),)


def write(root: Path, *paths: str) -> None:
    for path in paths:
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        (root / path).write_text("x = 1\n")


def test_a_linked_package_is_read_once(tmp_path: Path) -> None:
    """Monorepos give a package a second name; its functions must not be listed twice."""
    write(tmp_path, "z/control.py")
    (tmp_path / "a").symlink_to("z")
    write(tmp_path, "whole/other.py")
    (tmp_path / "whole" / "control.py").symlink_to("../z/control.py")
    survey = survey_source(str(tmp_path))
    assert survey.packages == ("whole", "z")
    paths = [module.path for module in survey.modules]
    assert len(paths) == 2 and "whole/other.py" in paths


def test_globs_choose_the_files_that_are_searched(tmp_path: Path) -> None:
    """The packages stay the target's, because the chosen files import the others."""
    write(tmp_path, "a/control/law.py", "a/view.py", "b/law.py")
    survey = survey_source(str(tmp_path), ("a/control/**",))
    assert [module.path for module in survey.modules] == ["a/control/law.py"]
    assert survey.packages == ("a", "b")
    with pytest.raises(
        MutatorError, match=r"no Python file of a, b matches nowhere/\*\*; expected globs relative"
    ):
        survey_source(str(tmp_path), ("nowhere/**",))


def test_globs_are_relative_to_the_folder_that_is_given(tmp_path: Path) -> None:
    """Also where the root is another one: below `src`, or above a package."""
    write(tmp_path, "src/pkg/control/law.py", "src/pkg/view.py", "src/pkg/__init__.py")
    (tmp_path / "pyproject.toml").touch()
    for folder, glob in (("", "src/pkg/control/**"), ("src/pkg", "control/**")):
        survey = survey_source(str(tmp_path / folder), (glob,))
        assert [module.path for module in survey.modules] == ["pkg/control/law.py"]
        assert survey.root == tmp_path / "src"


def test_a_module_of_the_target_shadows_none_of_the_standard_library(tmp_path: Path) -> None:
    """With `random.py` in the root, numpy would import the target's."""
    write(tmp_path, "law.py", "types.py", "random.py")
    survey = survey_source(str(tmp_path))
    assert survey.packages == ("law.py",)
    assert survey.shadowing_modules == ("random.py", "types.py")


def test_src_is_the_root_of_a_project_with_other_folders(tmp_path: Path) -> None:
    """`src.pkg` is not the name under which the package is imported."""
    write(tmp_path, "src/pkg/law.py", "utils/release.py")
    assert survey_source(str(tmp_path)).packages == ("src", "utils")
    (tmp_path / "pyproject.toml").touch()
    assert survey_source(str(tmp_path)).packages == ("pkg",)
