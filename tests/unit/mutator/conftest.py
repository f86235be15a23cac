"""Fixtures for unit tests: workspaces and a fork engine."""

import shutil
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mutator.campaigns import run_environment
from mutator.workspace import Workspace

from .fork_on_toy import Edit, Fork

HERE = Path(__file__).parent
CLONE = HERE.parents[2]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[Path], None]]:
    """Install a project as pip would: its folder and a dist-info with its entry points on the path."""

    def installed(project: Path) -> None:
        facts = tomllib.loads((project / "pyproject.toml").read_text())["project"]
        info = tmp_path / "site" / f"{facts['name'].replace('-', '_')}-{facts['version']}.dist-info"
        info.mkdir(parents=True)
        (info / "METADATA").write_text(f"Name: {facts['name']}\nVersion: {facts['version']}\n")
        lines = []
        for group, points in facts["entry-points"].items():
            lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items())]
        (info / "entry_points.txt").write_text("\n".join(lines))
        monkeypatch.syspath_prepend(info.parent)
        monkeypatch.syspath_prepend(project)

    forget_packages = run_environment._installed_packages.cache_clear  # a test may replace the function
    yield installed
    forget_packages()  # or later tests see the project


@pytest.fixture
def door_examples(install: Callable[[Path], None]) -> Path:
    project = CLONE / "tests" / "fixtures" / "doors"
    install(project)
    return project


@pytest.fixture
def toy(tmp_path: Path) -> Workspace:
    root = tmp_path / "toy"
    shutil.copytree(HERE / "toy", root, ignore=shutil.ignore_patterns("__pycache__"))
    return Workspace.find(root=root, templates=CLONE / "templates")


@pytest.fixture
def fork(toycar: Workspace, tmp_path: Path) -> Iterator[Fork]:
    made = Fork(toycar, tmp_path)
    yield made
    made.close()


@pytest.fixture
def edit(toycar: Workspace) -> Edit:
    def replaced(name: str, old: str, new: str) -> None:
        path = toycar.library.parent / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))

    return replaced
