"""The gate in the how-to page refuses a worse controller version and passes an equal one."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CLONE = Path(__file__).parents[2]
PAGE = CLONE / "docs" / "how-to" / "gate-a-change-in-ci.md"

pytestmark = pytest.mark.slow


@pytest.fixture
def root(tmp_path: Path) -> Path:
    toy = CLONE / "tests" / "toy"
    ignored = shutil.ignore_patterns("__pycache__", "hostile")
    shutil.copytree(toy / "fault_library", tmp_path / "fault_library", ignore=ignored)
    shutil.copytree(CLONE / "templates", tmp_path / "templates")
    for name in ("tree", "same", "worse"):
        shutil.copytree(toy / "tree", tmp_path / name, ignore=ignored)
    driver = tmp_path / "worse" / "toycar" / "driver.py"
    text = driver.read_text()
    driver.write_text(text.replace("-0.6 * offset", "-0.6 * (offset + 0.3)"))
    assert driver.read_text() != text
    [script] = re.findall(r"^```sh\n(#!/bin/sh\n.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    (tmp_path / "gate.sh").write_text(script)
    return tmp_path


def gate(root: Path, base: str, new: str) -> subprocess.CompletedProcess[str]:
    folder = root / "bin"
    folder.mkdir(exist_ok=True)
    command = folder / "mutator"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m mutator "$@"\n')
    command.chmod(0o755)
    environment = os.environ | {
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(CLONE),
        "MUTATOR_ROOT": str(root),
        "CAMPAIGN": "toy",
        "WORKERS": "0",
    }
    return subprocess.run(
        ["sh", "gate.sh", base, new], cwd=root, env=environment, capture_output=True, text=True, check=False
    )


def test_a_worse_version_is_refused(root: Path) -> None:
    refused = gate(root, "tree", "worse")
    assert refused.returncode == 1, refused.stderr
    named = [line for line in refused.stderr.splitlines() if line.startswith("error: ")]
    assert named
    assert all(line.startswith("error: new-hazard: sensor/") and "-> hazard (" in line for line in named)
    assert "Files of the target changed: toycar/driver.py." in refused.stdout
    shutil.rmtree(root / "runs" / "new")

    passed = gate(root, "tree", "same")
    assert passed.returncode == 0, passed.stderr
    assert "None of them changed." in passed.stdout
