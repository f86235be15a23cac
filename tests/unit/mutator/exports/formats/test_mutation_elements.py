"""Runs exported as mutation testing reports."""

import json
import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mutator.campaigns.plan import Plan
from mutator.errors import MutatorError
from mutator.exports import Format
from mutator.exports.formats.mutation_elements import mutant_status_as_json
from mutator.exports.run_export import export
from mutator.model import Anchor, AnchorKind, Experiment, Injection, Outcome, Record, Status
from mutator.workspace import Workspace

Write = Callable[..., Path]
STATUSES = {
    "Killed",
    "Survived",
    "NoCoverage",
    "CompileError",
    "RuntimeError",
    "Timeout",
    "Ignored",
    "Pending",
}
HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H1", 4.0),)}
IDLE = {"outcome": Outcome.NOT_ACTIVATED, "activation": None}


@pytest.fixture(scope="module")
def report(
    tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace], write_run: Write
) -> dict[str, Any]:
    tmp_path = tmp_path_factory.mktemp("report")
    toycar = copy_toycar(tmp_path)
    run = write_run(toycar, tmp_path / "run", lambda e: HAZARD if e.fault.fault_type == "lane" else {})
    file = export(run, Format.MUTATION_ELEMENTS, workspace=toycar)
    assert file == run.resolve() / "exports" / "mutation-elements.json"
    again = export(run, Format.MUTATION_ELEMENTS, tmp_path / "again.json", workspace=toycar)
    assert again.read_bytes() == file.read_bytes()
    data: dict[str, Any] = json.loads(file.read_text())
    return data


def mutants(report: dict[str, Any]) -> Iterator[tuple[str, dict[str, Any]]]:
    for file in report["files"].values():
        yield from ((file["source"], mutant) for mutant in file["mutants"])


def test_the_report_follows_the_schema(report: dict[str, Any]) -> None:
    assert re.fullmatch(r"([1-2]\d*|0)(\.(([1-9]\d*)|0)){0,2}", report["schemaVersion"])
    assert all(0 <= report["thresholds"][name] <= 100 for name in ("high", "low"))
    assert all(type(report["thresholds"][name]) is int for name in ("high", "low"))
    assert report["files"]
    for file in report["files"].values():
        assert isinstance(file["source"], str)
        assert file["language"] == "python"
    for _, mutant in mutants(report):
        assert mutant["status"] in STATUSES
        for name in ("id", "mutatorName", "description", "replacement", "statusReason"):
            assert isinstance(mutant[name], str)
        for name in ("coveredBy", "killedBy"):
            assert all(isinstance(test, str) for test in mutant[name])
    assert isinstance(report["framework"]["name"], str)
    ids = [mutant["id"] for _, mutant in mutants(report)]
    assert len(ids) == len(set(ids)) > 0


def test_each_run_is_listed_once_as_a_test(report: dict[str, Any]) -> None:
    tests = [test["id"] for file in report["testFiles"].values() for test in file["tests"]]
    assert len(tests) == len(set(tests))
    named = {test for _, m in mutants(report) for test in (*m["coveredBy"], *m["killedBy"])}
    assert named <= set(tests)
    assert set(report["testFiles"]) == {"A", "B"}


def test_a_mutant_replaces_whole_statements(report: dict[str, Any]) -> None:
    for source, mutant in mutants(report):
        start, end = mutant["location"]["start"], mutant["location"]["end"]
        lines = source.splitlines()[start["line"] - 1 : end["line"]]
        assert start["column"] == 1
        assert end["column"] == len(lines[-1]) + 1
        statement = [line.strip() for line in lines]
        replacement = [line.strip() for line in mutant["replacement"].splitlines()]
        assert [line for line in replacement if "# fi:" not in line] == statement
        assert any("# fi:" in line for line in replacement)


def test_a_mutant_of_an_operator_replaces_its_expression(
    toycar: Workspace, tmp_path: Path, write_run: Write, of_operators: Callable[..., Any]
) -> None:
    def changed(plan: Plan) -> Plan:
        mutants = of_operators(toycar, "toycar/driver.py", drives=1)(plan)
        first = mutants.experiments[0]

        def of(anchor: Anchor, model: str, **params: str) -> Experiment:
            place = replace(first.fault.injections[0].location, anchor=anchor)
            injection = Injection(location=place, model=model, params=tuple(params.items()))
            return replace(first, fault=replace(first.fault, fault_type=model, injections=(injection,)))

        minus = of(Anchor(kind=AnchorKind.VALUE, name="1.5 * speed"), "operator_infix", to="-")
        left_out = of(Anchor(kind=AnchorKind.BEFORE_ASSIGN, name="gas"), "omission")
        experiments = [*mutants.experiments, minus, left_out]
        return replace(mutants, experiments=experiments, chunks=(len(experiments),))

    run = write_run(toycar, tmp_path / "run", lambda e: HAZARD, changed=changed)
    made = json.loads(export(run, Format.MUTATION_ELEMENTS, workspace=toycar).read_text())
    *changes, (_, minus), (source, omission) = mutants(made)
    assert minus["replacement"] == "(1.5 - speed)"  # in `gap - 5.0 - 1.5 * speed`
    assert len(changes) == 9  # the binary operations in the file
    found = set()
    for source, mutant in changes:
        start, end = mutant["location"]["start"], mutant["location"]["end"]
        assert start["line"] == end["line"]
        text = source.splitlines()[start["line"] - 1][start["column"] - 1 : end["column"] - 1]
        assert mutant["mutatorName"] == "arithmetic" and mutant["status"] == "Survived"
        assert mutant["replacement"] == f"_fi.scaled(({text}), -1)"
        assert f"{text} -> -({text})" in mutant["description"]
        found.add(text)
    assert {"1.2 * closing", "wanted / 3.0", "-wanted / 6.0"} <= found
    line = source.splitlines()[omission["location"]["start"]["line"] - 1]
    assert line[omission["location"]["start"]["column"] - 1 :].startswith("gas = ")
    assert omission["location"]["end"]["column"] == len(line) + 1
    assert (omission["mutatorName"], omission["replacement"]) == ("omission", "pass")


def test_a_mutant_with_a_hazard_survives(report: dict[str, Any]) -> None:
    """Viewers show `Survived` in red and `Killed` in green, and count killed mutants in the score."""
    for _, mutant in mutants(report):
        lane = mutant["description"].startswith("sensor/lane/")
        assert mutant["status"] == ("Survived" if lane else "Killed")
        assert mutant["killedBy"] == ([] if lane else mutant["coveredBy"])
        assert not lane or mutant["coveredBy"][0] in mutant["statusReason"]


def test_a_run_whose_target_has_changed_is_refused(
    toycar: Workspace, tmp_path: Path, write_run: Write
) -> None:
    run = write_run(toycar, tmp_path / "run")
    (toycar.library.parent / "tree" / "toycar" / "driver.py").write_text("x = 1\n")
    with pytest.raises(MutatorError, match="changed since this run was planned: target"):
        export(run, Format.MUTATION_ELEMENTS, workspace=toycar)


@pytest.mark.parametrize(
    ("became", "status"),
    [
        ([{}, HAZARD], "Survived"),
        ([{}, {}], "Killed"),
        ([{}, None], "Pending"),
        ([HAZARD, None], "Survived"),
        ([{}, IDLE], "Killed"),
        ([IDLE, IDLE], "NoCoverage"),
        ([None, None], "Pending"),
        ([{"status": Status.CRASHED, "outcome": None}, {}], "RuntimeError"),
        ([{"status": Status.CRASHED, "outcome": None}, HAZARD], "Survived"),
        ([{"status": Status.TIMEOUT, "outcome": None}, {}], "RuntimeError"),
        ([{"status": Status.INVALID_MUTANT, "outcome": None, "activation": None}] * 2, "CompileError"),
        ([{"status": Status.HARNESS_ERROR, "outcome": None, "activation": None}] * 2, "Ignored"),
        ([{"status": Status.HARNESS_ERROR, "outcome": None, "activation": None}, {}], "Killed"),
    ],
)
def test_the_status_of_a_mutant_follows_from_its_experiments(
    became: list[dict[str, Any] | None],
    status: str,
    experiment: Callable[..., Experiment],
    record: Callable[..., Record],
) -> None:
    drives = [experiment(scenario=f"S{i}") for i in range(len(became))]
    records = {
        e.id: record(e.id, **fields) for e, fields in zip(drives, became, strict=True) if fields is not None
    }
    found = mutant_status_as_json(drives, records)
    assert found["status"] == status
    assert found["testsCompleted"] == sum(r.status is Status.OK for r in records.values())
