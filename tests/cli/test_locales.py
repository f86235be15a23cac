"""Non-ASCII names work with and without UTF-8 in the environment."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from mutator.workspace import Workspace

PLAIN = {"LC_ALL": "C"}  # where Python chooses UTF-8 automatically
NARROW = PLAIN | {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def mutator(place: Path, environment: dict[str, str], *words: str) -> "subprocess.CompletedProcess[str]":
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG"))}
    return subprocess.run(
        [sys.executable, "-m", "mutator", *words],
        cwd=place,
        env=kept | environment | {"MUTATOR_ROOT": "."},
        capture_output=True,
        encoding="utf-8",
        timeout=300,
    )


@pytest.fixture
def place(toy: Workspace) -> Path:
    root = toy.library.parent
    spec = toy.library / "faults" / "sensor" / "distance.yaml"
    spec.write_text(spec.read_text().replace("about: ", "about: Maß → ", 1), encoding="utf-8")
    return root


@pytest.mark.slow
def test_a_campaign_with_non_ascii_names_runs_in_the_c_locale(place: Path) -> None:
    (place / "tree" / "toycar" / "größe.py").write_text("SIZE = 1\n")
    root = place.rename(place.with_name("bücher"))
    answer = mutator(root, PLAIN, "run", "small", "--out", "läufe/1", "--limit", "1", "-n", "1")
    assert answer.returncode == 0, answer.stderr
    assert "läufe/1" in answer.stdout
    assert (root / "läufe" / "1" / "results.csv").exists()


def test_non_ascii_output_is_escaped_in_an_ascii_environment(place: Path) -> None:
    answer = mutator(place, NARROW, "list", "specs")
    assert (answer.returncode, "Ma\\xdf \\u2192" in answer.stdout) == (0, True)
    answer = mutator(place, NARROW, "list", "specs", "--json")
    assert (answer.returncode, "Ma\\u00df \\u2192" in answer.stdout) == (0, True)


@pytest.mark.parametrize("what", ["run folder", "library", "target file"])
def test_a_name_that_cannot_be_decoded_is_refused(place: Path, what: str) -> None:
    out = "run"
    if what == "run folder":
        out = "läufe"
    if what == "library":
        place = place.rename(place.with_name("bücher"))
    if what == "target file":
        (place / "tree" / "toycar" / "größe.py").touch()
    answer = mutator(place, NARROW, "plan", "small", "--out", out)
    assert (answer.returncode, answer.stdout) == (2, ""), answer.stderr
    assert "Traceback" not in answer.stderr
    assert answer.stderr.startswith("error: ")
    assert "cannot be encoded in this environment" in answer.stderr
    assert "LC_ALL=C.UTF-8" in answer.stderr
    assert not (place / out / "run.json").exists()
