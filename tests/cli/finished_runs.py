"""A finished run of the toy campaign, for the commands that read runs."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
CHOSEN = ["--only", 'fault_type != "distance"']  # some of these faults always cause a hazard


def mutator(root: Path, *words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "mutator", *map(str, words)]
    environment = os.environ | {"MUTATOR_ROOT": str(root)}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, cwd=root)


def finish_run(root: Path) -> subprocess.CompletedProcess[str]:
    """Copy the toy to `root`, run its campaign into `runs/first`, and return what the command printed."""
    shutil.copytree(TESTS / "toy", root, ignore=shutil.ignore_patterns("__pycache__", "templates", "hostile"))
    shutil.copytree(TESTS.parent / "templates", root / "templates")
    said = mutator(root, "run", "toy", "--out", "runs/first", "-n", "1", *CHOSEN)
    assert said.returncode == 0, said.stderr
    return said


def results(run: Path) -> list[str]:
    return (run / "results.csv").read_text().splitlines()


def experiment_with(run: Path, word: str) -> str:
    return next(line.split(",")[0] for line in results(run) if f",{word}," in line)
