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

CONTRAST = """\
schema: campaign/1
name: contrast
about: A picture with too much contrast.
target: openpilot
scenarios: [S2]
faults: [{spec: vision_input/contrast/gain}]
reading: as_described
methods: [guided]
triggers: {table: accelerate_decelerate, rows: [C1], armed_after_s: 1.5}
seed: 1
canary: {spec: vision_output/path_model/both, scenario: S1, hazard: H3, at_s: 5.0}
"""

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
    write_gate_script(tmp_path)
    return tmp_path


def write_gate_script(folder: Path) -> None:
    [script] = re.findall(r"^```sh\n(#!/bin/sh\n.*?)^```$", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    (folder / "gate.sh").write_text(script)


def gate(root: Path, base: str, new: str, campaign: str = "toy") -> subprocess.CompletedProcess[str]:
    folder = root / "bin"
    folder.mkdir(exist_ok=True)
    command = folder / "mutator"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m mutator "$@"\n')
    command.chmod(0o755)
    environment = os.environ | {
        "PATH": f"{folder}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(CLONE),
        "MUTATOR_ROOT": str(root),
        "CAMPAIGN": campaign,
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
    assert all(
        line.startswith("error: new-hazard, new-silent-hazard: sensor/") and "-> hazard (" in line
        for line in named
    )
    assert "Files of the target changed: toycar/driver.py." in refused.stdout
    shutil.rmtree(root / "runs" / "new")

    passed = gate(root, "tree", "same")
    assert passed.returncode == 0, passed.stderr
    assert "None of them changed." in passed.stdout


def test_a_weaker_brake_is_refused_because_a_hazard_comes_earlier_and_without_its_alert(
    tmp_path: Path,
) -> None:
    """The hazard itself is not new, so that only the loss of its alert fails the gate."""
    for folder in ("fault_library", "templates", "target"):
        shutil.copytree(CLONE / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(tmp_path / "target", tmp_path / "weaker")
    control = tmp_path / "weaker" / "selfdrive" / "controls" / "lib" / "longcontrol.py"
    text = control.read_text()
    limited = text.replace("neg_limit = -brake_max\n", "neg_limit = -min(brake_max, 0.6)\n")
    assert limited != text
    control.write_text(limited)
    contrast = tmp_path / "fault_library" / "faults" / "vision_input" / "contrast.yaml"
    contrast.write_text(re.sub(r"values: \[1.2,.*\]", "values: [2.6]", contrast.read_text()))
    (tmp_path / "contrast.yaml").write_text(CONTRAST)
    write_gate_script(tmp_path)

    refused = gate(tmp_path, "target", "weaker", "contrast.yaml")
    assert refused.returncode == 1, refused.stderr
    named = " ".join(refused.stderr.split())
    assert "error: new-silent-hazard: vision_input/contrast/gain 2.6, S2, guided C1: hazard (H3" in named
    assert "error: new-hazard" not in named
    [before, after] = re.findall(r"H3 ([0-9.]+) s after activation", named)
    assert float(after) < float(before) - 1.5
