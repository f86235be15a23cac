"""Samplers of others drive a bench, as the page *Use your own search* says."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import mutator
from mutator.workspace import Workspace

_CLONE = Path(__file__).parents[2]
_PAGE = _CLONE / "docs" / "how-to" / "use-your-own-search.md"
_BLOCK = re.compile(r"^`(\w+\.py)`:\n\n```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize(("sampler", "experiment_count"), [("optuna", 6), ("pymoo", 8), ("verifai", 6)])
def test_a_sampler_drives_a_bench(tmp_path: Path, sampler: str, experiment_count: int) -> None:
    """The script of the page asks, runs and tells, and leaves a finished run folder with its batches."""
    pytest.importorskip(sampler)
    for name, text in _BLOCK.findall(_PAGE.read_text(encoding="utf-8")):
        (tmp_path / name).write_text(text)
    script = [sys.executable, f"with_{sampler}.py"]
    environment = os.environ | {"MUTATOR_ROOT": str(_CLONE)}
    ended = subprocess.run(script, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.startswith(f"{sampler}: ")
    run = mutator.load_run(tmp_path / "runs" / sampler, workspace=Workspace.find(root=_CLONE))
    assert run.seal and len(run.records) == experiment_count
    lines = (run.folder.path / "plan" / "batches.jsonl").read_text().splitlines()
    assert len(lines) == experiment_count // 2 if sampler != "pymoo" else len(lines) == 2


def test_the_page_has_a_script_for_each_sampler() -> None:
    """A script that the test above does not find would not be tested."""
    assert [name for name, _ in _BLOCK.findall(_PAGE.read_text(encoding="utf-8"))] == [
        "danger.py",
        *(f"with_{sampler}.py" for sampler in ("optuna", "pymoo", "verifai")),
    ]
