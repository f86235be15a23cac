"""Surveys a source tree: packages, flat modules and their syntax trees. Nothing is imported."""

import ast
import keyword
import os
import sys
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path

from mutator._common.bounded_reading import read_bounded
from mutator._common.confined_files import checked_path_inside
from mutator.errors import MutatorError, UnsafePath
from mutator.targets.root_package_and_overlay_search import INSTALLED_PREFIX, find_installed_package
from mutator.targets.source_tree import MOST_SOURCE_BYTES, matches_any_glob

_MOST_FILES = 5000  # a controller has hundreds; more are a home folder or an environment, passed by mistake
_SKIPPED_FOLDERS_AND_MODULES = {
    *("test", "tests", "testing", "doc", "docs", "example", "examples", "benchmark", "benchmarks", "scripts"),
    *("build", "dist", "node_modules", "site-packages", "venv", "env", "__pycache__"),
}
_PROJECT_FILES = ("pyproject.toml", "setup.py", "setup.cfg")
_SKIPPED_FILES = {"setup.py", "conftest.py", "noxfile.py", "__init__.py", "__main__.py"}


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceModule:
    """A Python file. The path is relative to the root."""

    path: str
    tree: ast.Module

    @property
    def name(self) -> str:
        return self.path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceSurvey:
    """A source tree, described in the terms of a manifest."""

    root: Path  # the folder for `sys.path`
    packages: tuple[str, ...]  # import packages and flat modules (`drive.py`)
    modules: tuple[SourceModule, ...]  # the files that were read
    unreadable_files: tuple[
        tuple[str, str], ...
    ] = ()  # `path:line` and reason of each file that cannot be read
    shadowing_modules: tuple[str, ...] = ()  # flat modules left out: they have names of the standard library
    installed_package: str | None = None
    requirement: str | None = None  # requirement for the installed distribution


def survey_source(target: str, globs: Sequence[str] = ()) -> SourceSurvey:
    """Survey a folder, or the package `installed:NAME`; with `globs`, read only the files that match one.

    Globs are relative to the folder, or to where the package is installed. MutatorError if the target does
    not exist or no file matches.
    """
    survey = _survey_all(target, globs)
    if globs and not (survey.modules or survey.unreadable_files):
        raise MutatorError(
            f"no Python file of {', '.join(survey.packages) or target} matches {', '.join(globs)}",
            argument="files",
            expected=f"globs relative to {survey.root if survey.installed_package else target}, such as "
            "`pkg/control/**`",
            remedy="correct the glob",
        )
    return survey


def _survey_all(target: str, globs: Sequence[str]) -> SourceSurvey:
    if target.startswith(INSTALLED_PREFIX):
        return _survey_installed(target.removeprefix(INSTALLED_PREFIX), globs)
    folder = start = Path(target).resolve()
    if folder.is_file():
        raise MutatorError(
            f"{target} is a file",
            argument="target",
            expected="the folder that holds a controller's source",
            remedy=f"give its folder, and search only this file with `--in '**/{folder.name}'`",
        )
    if not folder.is_dir():
        raise MutatorError(
            f"no folder {target}",
            argument="target",
            expected=f"the folder that holds a controller's source, or {INSTALLED_PREFIX}NAME",
            remedy="correct `target`",
        )
    if (folder / "__init__.py").exists():
        return _survey_packages(folder.parent, (folder.name,), start, globs)
    packages = [*_packages_in(folder)]
    if "src" in packages and _is_source_folder(folder, packages):
        folder /= "src"
        packages = [*_packages_in(folder)]
    shadowing = tuple(name for name in packages if name.removesuffix(".py") in sys.stdlib_module_names)
    own_packages = tuple(name for name in packages if name not in shadowing)
    survey = _survey_packages(folder, own_packages, start, globs)
    return replace(survey, shadowing_modules=shadowing)


def _is_source_folder(folder: Path, packages: Sequence[str]) -> bool:
    """Return whether `src` is not a package, but holds those of the project."""
    source = folder / "src"
    is_project = [*packages] == ["src"] or any((folder / file).exists() for file in _PROJECT_FILES)
    return is_project and not (source / "__init__.py").exists() and any(_packages_in(source))


def _survey_installed(name: str, globs: Sequence[str]) -> SourceSurvey:
    package_path = find_installed_package(name) if name.isidentifier() else None
    if package_path is None:
        raise MutatorError(
            f"no installed package '{name}'",
            argument="target",
            expected="the import name of a package",
            remedy="install it in mutator's environment, or correct the name",
        )
    root = package_path.parent
    survey = _survey_packages(root, (package_path.name,), root, globs, any_links=True)
    return replace(survey, installed_package=name, requirement=_distribution_requirement(name))


def _distribution_requirement(name: str) -> str | None:
    owners = metadata.packages_distributions().get(name)
    return f"{owners[0]}>={metadata.version(owners[0])}" if owners else None


def _packages_in(folder: Path) -> Iterator[str]:
    """Yield packages (with or without `__init__.py`) and flat modules, except tests, docs and scripts.

    Of the links to a package that is there, too, none is yielded.
    """
    try:
        entries = sorted(folder.iterdir())
    except OSError as err:
        raise MutatorError(
            f"cannot be read ({err.strerror})", where=folder, remedy="check its permissions"
        ) from None
    real_paths = {path for path in entries if not path.is_symlink()}
    for path in entries:
        if path.is_symlink() and path.resolve() in real_paths:
            continue
        stem = path.name.removesuffix(".py")
        if not _is_importable(stem) or stem in _SKIPPED_FOLDERS_AND_MODULES:
            continue
        if path.is_dir():
            if any(_python_files(path)):
                yield path.name
        elif _is_module(path) and path.name not in _SKIPPED_FILES and not stem.startswith("test_"):
            yield path.name


def _python_files(folder: Path) -> Iterator[Path]:
    """Yield Python files below a folder, except in tests, hidden folders and virtual environments."""
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(n for n in folders if _is_importable(n) and n not in _SKIPPED_FOLDERS_AND_MODULES)
        if "pyvenv.cfg" in names:
            folders.clear()
            continue
        yield from filter(_is_module, (Path(place, name) for name in sorted(names)))


def _is_module(path: Path) -> bool:
    return path.suffix == ".py" and _is_importable(path.stem) and path.is_file()


def _is_importable(name: str) -> bool:
    return name.isidentifier() and not keyword.iskeyword(name)


def _parse(path: Path) -> ast.Module:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # warnings concern the controller's code
        return ast.parse(read_bounded(path, MOST_SOURCE_BYTES))


def _survey_packages(
    root: Path, packages: tuple[str, ...], start: Path, globs: Sequence[str], *, any_links: bool = False
) -> SourceSurvey:
    """Read the modules of packages, each file once; with `any_links`, links may point out of the root.

    `globs` are relative to `start`, which holds the root, or is a package in it.
    """
    modules: list[SourceModule] = []
    unread: list[tuple[str, str]] = []
    real_paths = set[Path]()
    # links last, so that a file has the name under which it is stored
    for name in sorted(packages, key=lambda name: (root / name).is_symlink()):
        for path in [root / name] if name.endswith(".py") else _python_files(root / name):
            if globs and not matches_any_glob(path.relative_to(start).as_posix(), globs):
                continue
            if path.resolve() in real_paths:
                continue
            real_paths.add(path.resolve())
            if len(modules) + len(unread) == _MOST_FILES:
                raise MutatorError(
                    f"more than {_MOST_FILES} Python files",
                    argument="target",
                    where=root,
                    expected="the source of one controller",
                    remedy="pass a subfolder, or choose files with `files`",
                )
            relative = path.relative_to(root).as_posix()
            try:
                if not any_links:
                    checked_path_inside(root, path)
                modules.append(SourceModule(path=relative, tree=_parse(path)))
            except UnsafePath as err:
                unread.append((f"{relative}:1", err.got))
            except (SyntaxError, ValueError, RecursionError, MemoryError, OSError) as err:
                line = getattr(err, "lineno", None) or 1
                unread.append((f"{relative}:{line}", getattr(err, "msg", None) or str(err)))
    return SourceSurvey(root=root, packages=packages, modules=tuple(modules), unreadable_files=tuple(unread))
