"""Runs exported as JUnit XML."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.errors import MutatorError, MutatorWarning
from mutator.exports import ExportSelection, Format
from mutator.exports.run_export import export
from mutator.model import Experiment, Outcome, Status
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

BECAME: dict[str, dict[str, Any] | None] = {
    "lane": {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),), "alerts": (("brake_hard", 3.0),)},
    "silence": {
        "status": Status.HARNESS_ERROR,
        "outcome": None,
        "activation": None,
        "detail": "no <disk>\x00 & so on",
    },
}


def became(e: Experiment) -> dict[str, Any] | None:
    if e.fault.fault_type in BECAME:
        return BECAME[e.fault.fault_type]
    if e.method.value == "random":
        return None
    return {"outcome": Outcome.NOT_ACTIVATED, "activation": None} if e.scenario == "B" else {}


@pytest.fixture(scope="module")
def run(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
) -> Path:
    folder = tmp_path_factory.mktemp("junit")
    return write_run(copy_toycar(folder), folder / "run", became)


def cases(file: Path) -> dict[str, list[ET.Element]]:
    root = ET.parse(file).getroot()
    suites = root.findall("testsuite")
    for element in (root, *suites):
        assert int(element.get("tests", "")) == len(list(element.iter("testcase")))
        for name, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
            assert int(element.get(name, "")) == len(list(element.iter(tag)))
    return {suite.get("name", "").split("/")[1]: suite.findall("testcase") for suite in suites}


def test_hazards_pass_by_default_and_harness_errors_are_errors(run: Path) -> None:
    file = export(run, Format.JUNIT)
    found = cases(file)
    assert set(found) == {"lane", "silence", "distance"}
    assert ET.parse(file).getroot().get("failures") == "0"
    for case in found["lane"]:
        assert [child.tag for child in case] == ["properties"]
        told = {p.get("name"): p.get("value") for p in case.iter("property")}
        assert (told["ending"], told["hazard H3 [s]"], told["alerts"]) == ("hazard", "4.00", "brake_hard")
        assert "Hazard H3 occurs 2.00 s later" in told["sentence"]
    for case in found["silence"]:
        assert case.find("error").get("message") == "no <disk>? & so on"  # type: ignore[union-attr]
    skipped = {
        case.find("skipped") is not None
        for case in found["distance"]
        if "guided" not in str(case.get("name"))
    }
    assert skipped == {True}


def test_hazards_can_be_selected_as_failures(run: Path, tmp_path: Path) -> None:
    found = cases(
        export(run, Format.JUNIT, tmp_path / "j.xml", selection=ExportSelection(failures=["hazard"]))
    )
    messages = [str(c.find("failure").get("message")) for c in found["lane"]]  # type: ignore[union-attr]
    assert all(
        "Hazard H3 occurs 2.00 s later. Alert brake_hard 1.00 s before" in message for message in messages
    )
    assert not any(list(c.iter("failure")) for c in found["distance"])


def test_a_harness_error_cannot_be_selected_as_a_failure(run: Path) -> None:
    """Harness errors say nothing about the controller."""
    with pytest.raises(MutatorError, match="harness_error"):
        export(run, Format.JUNIT, selection=ExportSelection(failures=["harness_error"]))


def test_csv_and_parquet_exports_are_copies_of_the_runs_tables(run: Path, tmp_path: Path) -> None:
    for format, name in ((Format.CSV, "results.csv"), (Format.PARQUET, "results.parquet")):
        file = export(run, format, tmp_path / "new" / name)
        assert file.read_bytes() == (run / name).read_bytes()


def test_cases_have_the_place_of_their_fault_if_the_target_is_there(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    (tmp_path / ".git").mkdir()
    folder = write_run(toycar, tmp_path / "run", became)
    assert cases(export(folder, Format.JUNIT))["lane"][0].get("file") is None
    for case in cases(export(folder, Format.JUNIT, workspace=toycar))["lane"]:
        lines = (tmp_path / str(case.get("file"))).read_text().splitlines()
        assert lines[int(str(case.get("line"))) - 1].strip().startswith("offset = ")
    (toycar.library.parent / "tree" / "toycar" / "driver.py").write_text("x = 1\n")
    with pytest.warns(MutatorWarning, match="JUnit without files and lines: .* has changed since"):
        assert cases(export(folder, Format.JUNIT, workspace=toycar))["lane"][0].get("file") is None


def test_times_are_those_of_the_runs_and_add_up(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = write_run(toycar, tmp_path / "run", became)
    ids = list(RunFolder.open(folder).experiment_ids())
    monkeypatch.setattr(RunFolder, "timings", lambda run: {name: {"wall_s": 0.25} for name in ids[:4]})
    root = ET.parse(export(folder, Format.JUNIT)).getroot()
    assert (
        sorted(str(case.get("time")) for case in root.iter("testcase") if case.get("time")) == ["0.250"] * 4
    )
    assert root.get("time") == "1.000"
    assert sum(float(str(suite.get("time"))) for suite in root.findall("testsuite")) == 1.0
