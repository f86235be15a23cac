"""The whole way of the reproduction, with a few faults of each campaign: drive, write, check."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
PAGE = "pages/docs/explanation/paper-results.md"


def reproduce(clone: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": str(clone)}
    command = [sys.executable, "-m", "mutator.paper.reproduce", "--small", *arguments]
    return subprocess.run(command, cwd=clone, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_small_study_is_driven_written_and_checked(tmp_path: Path) -> None:
    """A number edited by hand and an exchanged run folder are found; a changed clone is refused."""
    clone, out = tmp_path / "clone", tmp_path / "study"
    subprocess.run(["git", "clone", "-q", "--no-hardlinks", str(CLONE), str(clone)], check=True)
    first = reproduce(clone, "--out", str(out), "-n", "2", "--only", "described")
    assert first.returncode == 0, first.stderr
    assert "pages need coded, coded_2_75, " in first.stdout and not (out / PAGE).exists()
    check = reproduce(clone, "--check", "--out", str(out), "--only", "described")
    assert check.returncode == 1 and check.stdout.startswith("docs/explanation/tables: no rows of coded, ")
    done = reproduce(clone, "--out", str(out), "-n", "2")
    assert done.returncode == 0, done.stderr
    again = reproduce(clone, "--out", str(out), "-n", "2")
    assert again.returncode == 0 and again.stdout.count(": finished") == 6
    check = reproduce(clone, "--check", "--out", str(out))
    assert check.returncode == 0, check.stdout + check.stderr
    assert "belong together" in check.stdout
    page = out / PAGE
    text = page.read_text()
    page.write_text(text.replace("35.8 %", "35.7 %", 1))
    check = reproduce(clone, "--check")
    assert check.returncode == 2  # a small study has its pages in its folder
    check = reproduce(clone, "--check", "--out", str(out))
    assert check.returncode == 1 and "should:" in check.stdout
    page.write_text(text)
    shutil.rmtree(out / "runs" / "coded")
    shutil.copytree(out / "runs" / "described", out / "runs" / "coded")
    check = reproduce(clone, "--check", "--out", str(out))
    assert check.returncode == 1 and "not the campaign 'coded' of the study" in check.stdout
    (clone / "target" / "new.py").write_text("")
    refused = reproduce(clone, "--out", str(out))
    assert refused.returncode == 2 and "not committed" in refused.stderr
