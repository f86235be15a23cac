"""Hazards exported for GitLab's code quality report."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mutator.exports import ExportSelection, Format
from mutator.exports.run_export import export
from mutator.model import Experiment, Outcome
from mutator.workspace import Workspace


def test_each_new_hazard_is_an_entry_with_its_place(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    def hazard_of(kind: str) -> Callable[[Experiment], dict[str, Any]]:
        hazard = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),)}
        return lambda e: hazard if e.fault.fault_type == kind else {}

    (tmp_path / ".git").mkdir()
    base = write_run(toycar, tmp_path / "base", hazard_of("silence"))
    run = write_run(toycar, tmp_path / "run", hazard_of("lane"))
    entries = json.loads(export(run, Format.CODEQUALITY, workspace=toycar).read_text())
    assert entries
    assert len({entry["fingerprint"] for entry in entries}) == len(entries)
    for entry in entries:
        assert entry["check_name"] == "offset"
        assert entry["severity"] in ("info", "minor", "major", "critical", "blocker")
        assert "Hazard H3 occurs" in entry["description"]
        lines = (tmp_path / entry["location"]["path"]).read_text().splitlines()
        assert lines[entry["location"]["lines"]["begin"] - 1].strip().startswith("offset = ")
    new = export(run, Format.CODEQUALITY, workspace=toycar, selection=ExportSelection(base=base))
    assert json.loads(new.read_text()) == entries
    same = export(run, Format.CODEQUALITY, workspace=toycar, selection=ExportSelection(base=run))
    assert json.loads(same.read_text()) == []
