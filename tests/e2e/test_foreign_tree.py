"""A target of flat modules with glue in an overlay and no hazard analysis, from `run` to `verify`."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from mutator.cli.app import main
from mutator.workspace import Workspace

Cli = Callable[..., tuple[int, str]]


@pytest.fixture
def cli(pole: Workspace, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Cli:
    monkeypatch.setenv("MUTATOR_LIBRARY", str(pole.library))
    monkeypatch.setenv("MUTATOR_TEMPLATES", str(pole.templates))

    def run(*words: object) -> tuple[int, str]:
        capfd.readouterr()
        code = main([str(word) for word in words])
        return code, capfd.readouterr().out

    return run


@pytest.mark.slow
def test_both_engines_give_the_same_table(cli: Cli, pole: Workspace, tmp_path: Path) -> None:
    tables = {}
    for engine in ("reference", "fork"):
        code, said = cli("run", "upright", "--out", tmp_path / engine, "-n", "0", "--engine", engine)
        assert code == 0 and "18 of 18 experiments done" in said
        tables[engine] = (tmp_path / engine / "results.csv").read_bytes()
    assert "proof: 18 of 18 experiments came out the same" in said
    assert tables["reference"] == tables["fork"]
    head = json.loads((tmp_path / "fork" / "run.json").read_text())
    assert {"drive.py", "glue_parts/scenario.py", "regulator.py"} <= head["target_files"].keys()
    assert "alert" not in said
    report = (tmp_path / "fork" / "report" / "REPORT.md").read_text()
    assert not [
        line for line in report.splitlines() if line.startswith(("|", "## ")) and "alert" in line.lower()
    ]
    assert cli("verify", tmp_path / "fork")[0] == 0
    first = next(line for line in tables["fork"].decode().splitlines()[1:] if ",hazard" in line).split(",")[0]
    assert cli("rerun", first, "--run", tmp_path / "fork")[0] == 0
    glue = pole.library / "overlays" / "pole" / "glue_parts" / "scenario.py"
    glue.write_text(glue.read_text() + "# changed\n")
    code, _ = cli("rerun", first, "--run", tmp_path / "fork")
    assert code == 2, "the changed glue was not refused"
