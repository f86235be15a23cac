"""The command line, run in this process on a copy of the toy target and its library."""

import json
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from mutator.cli.app import main
from mutator.workspace import Workspace

from .finished_runs import finish_run

TOY = Path(__file__).parents[1] / "toy"


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


Cli = Callable[..., Answer]


@pytest.fixture
def cli(capfd: pytest.CaptureFixture[str]) -> Cli:
    def run(*words: object) -> Answer:
        capfd.readouterr()
        code = main([str(word) for word in words])
        out, err = capfd.readouterr()
        return Answer(code, out, err)

    return run


@pytest.fixture
def root(toy: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept_checks: None) -> Path:
    """The toy's root, set in the environment, without the deliberately broken parts. The current folder is
    elsewhere."""
    root = toy.library.parent
    shutil.rmtree(toy.library / "faults" / "hostile")
    for template in (TOY / "templates").iterdir():
        (toy.templates / template.name).unlink()
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setenv("MUTATOR_ROOT", str(root))
    return root


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder. The environment names no library."""
    for name in ("ROOT", "LIBRARY", "TEMPLATES", "TARGET"):
        monkeypatch.delenv(f"MUTATOR_{name}", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def finished(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """The root with the finished run `runs/first`, and what `mutator run` printed."""
    root = tmp_path_factory.mktemp("finished") / "toy"
    return root, finish_run(root)


@pytest.fixture
def run(finished: tuple[Path, Any], monkeypatch: pytest.MonkeyPatch) -> Path:
    root, _ = finished
    monkeypatch.chdir(root)
    monkeypatch.setenv("MUTATOR_ROOT", str(root))
    return root / "runs" / "first"


@pytest.fixture(scope="session")
def shared_run(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """A list of the shared run folder and, once known, its seal."""
    return [tmp_path_factory.mktemp("shared") / "run"]


@pytest.fixture
def sealed(cli: Cli, root: Path, shared_run: list[Any]) -> str:
    """The seal that `mutator run` prints. All tests share the folder `run`, because they have the same
    library."""
    kept, *seals = shared_run
    if not seals:
        ran = cli("run", "small", "--out", "run", "-n", "0", "--limit", 4, "--engine", "fork")
        assert ran.code == 0, ran.err
        found = re.search(r"^seal: ([0-9a-f]{64})$", ran.out, re.MULTILINE)
        assert found
        shared_run.append(found[1])
        shutil.copytree("run", kept)
    elif not Path("run").exists():
        shutil.copytree(kept, "run")
    return str(shared_run[1])


@pytest.fixture
def copy(cli: Cli, sealed: str, tmp_path: Path) -> Path:
    """A copy of the sealed run, which a test can change."""
    return Path(shutil.copytree("run", tmp_path / "copy"))
