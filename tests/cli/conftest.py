"""The command line in this process, on a copy of the toy target and its library."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from mutator.cli.main import main

CLONE = Path(__file__).parents[2]
TOY = CLONE / "tests" / "unit" / "mutator" / "toy"


@dataclass(frozen=True)
class Answer:
    """What a command line printed, and its exit code."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        return json.loads(self.out)


Cli = Callable[..., Answer]


@pytest.fixture
def cli(capfd: pytest.CaptureFixture[str]) -> Cli:
    """Runs `mutator WORDS...` and gives its answer."""

    def run(*words: object) -> Answer:
        capfd.readouterr()
        code = main([str(word) for word in words])
        out, err = capfd.readouterr()
        return Answer(code, out, err)

    return run


@pytest.fixture
def toy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with library and target of the toy, named by the environment; the current one is another."""
    root = tmp_path / "toy"
    shutil.copytree(TOY, root, ignore=shutil.ignore_patterns("__pycache__"))
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    monkeypatch.setenv("MUTATOR_ROOT", str(root))
    monkeypatch.setenv("MUTATOR_TEMPLATES", str(CLONE / "templates"))
    return root


@pytest.fixture
def nowhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder as the current one, and no environment that names a library."""
    for name in ("ROOT", "LIBRARY", "TEMPLATES", "TARGET"):
        monkeypatch.delenv(f"MUTATOR_{name}", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path
