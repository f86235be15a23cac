"""Hazards exported as SARIF."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError, MutatorWarning
from mutator.exports import ExportSelection, Format
from mutator.exports.code_findings import LEVELS_BY_SEVERITY
from mutator.exports.formats import sarif
from mutator.exports.run_export import export
from mutator.model import Experiment, Outcome
from mutator.store.plan_file import load_experiments
from mutator.targets.hazard_severity import SEVERITY_CLASSES
from mutator.workspace import Workspace

Write = Callable[..., Path]
HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),)}


def lane_hazard(experiment: Experiment) -> dict[str, Any]:
    return HAZARD if experiment.fault.fault_type == "lane" else {}


def lane_and_silence_hazard(experiment: Experiment) -> dict[str, Any]:
    return HAZARD if experiment.fault.fault_type in ("lane", "silence") else {}


@pytest.fixture(scope="module")
def runs(workspace: Workspace, write_run: Write) -> tuple[Path, Path]:
    """A run, and one in which one more kind of fault leads to hazards."""
    folder = workspace.library.parent
    return (
        write_run(workspace, folder / "base", lane_hazard),
        write_run(workspace, folder / "new", lane_and_silence_hazard),
    )


def logged(run: Path, workspace: Workspace, **selected: Any) -> dict[str, Any]:
    file = export(run, Format.SARIF, workspace=workspace, selection=ExportSelection(**selected))
    log: dict[str, Any] = json.loads(file.read_text())
    return log


def test_the_log_has_what_the_schema_and_code_scanning_require(
    workspace: Workspace, runs: tuple[Path, Path]
) -> None:
    log = logged(runs[1], workspace)
    assert log["version"] == "2.1.0"
    [run] = log["runs"]
    rules = run["tool"]["driver"]["rules"]
    assert len({rule["id"] for rule in rules}) == len(rules)
    for rule in rules:
        assert rule["shortDescription"]["text"] and rule["fullDescription"]["text"]
    assert run["results"]
    for result in run["results"]:
        assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
        assert result["level"] in ("error", "warning", "note")
        [location] = result["locations"]
        place = location["physicalLocation"]
        source = workspace.library.parent / place["artifactLocation"]["uri"]
        lines = source.read_text().splitlines()
        assert 1 <= place["region"]["startLine"] <= place["region"]["endLine"] <= len(lines)


def test_a_result_names_fault_place_and_experiment(workspace: Workspace, runs: tuple[Path, Path]) -> None:
    results = logged(runs[0], workspace)["runs"][0]["results"]
    assert {result["ruleId"] for result in results} == {"offset"}
    for result in results:
        assert result["message"]["text"].startswith("sensor/lane/shifted ")
        assert "Hazard H3 occurs" in result["message"]["text"]
        assert result["locations"][0]["logicalLocations"][0]["fullyQualifiedName"] == "Sensor.sense"
        experiment = result["properties"]["experiment"]
        assert set(result["partialFingerprints"].values()) == {experiment}
        assert "primaryLocationLineHash" in result["partialFingerprints"]


def test_a_changed_controller_leaves_the_fingerprints(
    workspace: Workspace, runs: tuple[Path, Path], tmp_path: Path, write_run: Write
) -> None:
    """A dismissed alert must stay dismissed, although its line has moved."""
    shutil.copytree(workspace.library.parent, tmp_path / "other")
    other = Workspace.find(tmp_path / "other")
    sensing = tmp_path / "other" / "tree" / "toycar" / "sensing.py"
    sensing.write_text("# moved\n\n" + sensing.read_text())
    run = write_run(other, tmp_path / "run", lane_hazard)
    before, after = logged(runs[0], workspace), logged(run, other)

    def line_by_fingerprint(log: dict[str, Any]) -> dict[str, int]:
        return {
            result["partialFingerprints"]["primaryLocationLineHash"]: result["locations"][0][
                "physicalLocation"
            ]["region"]["startLine"]
            for result in log["runs"][0]["results"]
        }

    assert line_by_fingerprint(after) == {k: v + 2 for k, v in line_by_fingerprint(before).items()}


def test_hazards_of_the_base_are_left_out(workspace: Workspace, runs: tuple[Path, Path]) -> None:
    base, new = runs
    [run] = logged(new, workspace, base=base)["runs"]
    assert run["results"]
    for result in run["results"]:
        assert result["message"]["text"].startswith("sensor/silence/")
        assert result["baselineState"] == "new"
    assert logged(base, workspace, base=new)["runs"][0]["results"] == []


def test_a_mutant_of_an_operator_has_the_operator_as_its_rule(
    workspace: Workspace, tmp_path: Path, write_run: Write, of_operators: Callable[..., Any]
) -> None:
    changed = of_operators(workspace, "toycar/driver.py", drives=1)
    run = write_run(workspace, tmp_path / "run", lambda e: HAZARD, changed=changed)
    [log] = logged(run, workspace)["runs"]
    [rule] = log["tool"]["driver"]["rules"]
    assert rule["id"] == "arithmetic"
    assert rule["shortDescription"]["text"].startswith("Mutation operator arithmetic")
    for result in log["results"]:
        place = result["locations"][0]["physicalLocation"]
        lines = (workspace.library.parent / place["artifactLocation"]["uri"]).read_text().splitlines()
        expression = re.search(r"-> -\((.*?)\)[ ,]", result["message"]["text"])
        assert expression and expression[1] in lines[place["region"]["startLine"] - 1]


def test_levels_follow_the_severity(workspace: Workspace, runs: tuple[Path, Path]) -> None:
    """The toy has no severity scale, so its hazards are warnings."""
    assert {*LEVELS_BY_SEVERITY} == {"", *SEVERITY_CLASSES}
    results = logged(runs[0], workspace)["runs"][0]["results"]
    assert {result["level"] for result in results} == {"warning"}


def test_hazards_beyond_the_limit_of_code_scanning_are_counted(
    workspace: Workspace, runs: tuple[Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sarif, "MOST_RESULTS", 2)
    with pytest.warns(MutatorWarning, match="left out, because code scanning takes at most 2 results"):
        assert len(logged(runs[1], workspace)["runs"][0]["results"]) == 2


def test_hazards_outside_of_a_repository_are_left_out_with_a_warning(
    toycar: Workspace, tmp_path: Path, write_run: Write
) -> None:
    run = write_run(toycar, tmp_path / "run", lane_hazard)
    with pytest.warns(MutatorWarning, match="their files are in no repository: "):
        assert logged(run, toycar)["runs"][0]["results"] == []


def test_a_run_whose_target_has_changed_is_refused(
    toycar: Workspace, tmp_path: Path, write_run: Write
) -> None:
    run = write_run(toycar, tmp_path / "run", lane_hazard)
    (toycar.library.parent / "tree" / "toycar" / "driver.py").write_text("x = 1\n")
    with pytest.raises(MutatorError, match="has changed since this run was planned"):
        export(run, Format.SARIF, workspace=toycar)


def test_hazards_of_new_experiments_are_new(
    workspace: Workspace, runs: tuple[Path, Path], tmp_path: Path, write_run: Write
) -> None:
    part = write_run(workspace, tmp_path / "part", lane_and_silence_hazard, limit=6)
    planned = {e.id for e in load_experiments(part)}
    whole = logged(runs[1], workspace)["runs"][0]["results"]
    new = logged(runs[1], workspace, base=part)["runs"][0]["results"]
    ids = [result["properties"]["experiment"] for result in new]
    assert ids == [
        result["properties"]["experiment"]
        for result in whole
        if result["properties"]["experiment"] not in planned
    ]
    assert 0 < len(new) < len(whole)
