"""The source view of a run with mutation operators, and the panels that use it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mutator.api.runs import load_run
from mutator.model import Experiment, Outcome, Status
from mutator.report.experiment_list_data import _list_table_data, _listed_results
from mutator.report.panels.mutation_score_panel import build_mutation_score_panel
from mutator.report.panels.source_panel import build_source_panel
from mutator.report.reported_run import ReportedRun
from mutator.report.source_lines_with_outcomes import LineMark
from mutator.results import table_building
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

from .made_run import Page

DRIVER = "toycar/driver.py"
HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),), "t_manifest": 2.5}
IDLE = {"outcome": Outcome.NOT_ACTIVATED, "activation": None}
FAILED = {"status": Status.HARNESS_ERROR, "outcome": None, "detail": "the disk is gone"}


def at(text: str) -> int:
    """The number, from 1, of the driver's line that begins with this text."""
    lines = (Path(__file__).parents[3] / "toy" / "tree" / DRIVER).read_text().splitlines()
    return next(number for number, line in enumerate(lines, 1) if line.strip().startswith(text))


def result_of(experiment: Experiment) -> dict[str, Any]:
    """Return a mutant's result: FAILED for the pedals; IDLE or HAZARD for a permanent mutant; masked for a
    transient one."""
    place = str(experiment.fault.value)
    if "3.0" in place or "6.0" in place:
        return FAILED
    if experiment.trigger.name != "always":
        return {}
    return IDLE if place.startswith("1.2 * closing") else HAZARD


@pytest.fixture
def run(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path], of_operators: Callable[..., Any]
) -> Path:
    out = write_run(toycar, tmp_path / "run", result_of, changed=of_operators(toycar, DRIVER))
    table_building.build_tables(out)
    (out / "report").mkdir()
    return out


def test_lines_have_the_worst_outcome_of_their_mutants(toycar: Workspace, run: Path) -> None:
    """A harness error is not an outcome."""
    source = ReportedRun.open(RunFolder.open(run), toycar).source_lines
    assert source is not None
    (file,) = source.files
    wanted = file.marks[at("wanted =")]
    assert wanted["permanent"] == LineMark(worst_ending="hazard", worst_mutant_count=5, mutant_count=6)
    assert wanted["transient"] == LineMark(worst_ending="masked", worst_mutant_count=6, mutant_count=6)
    assert at("gas =") not in file.marks and at("brake =") not in file.marks
    assert file.line_counts_by_ending() == {"hazard": 2}
    assert file.shown_lines == (range(at("def drive"), len(file.lines) + 1),)


def test_a_line_leads_to_its_experiments(toycar: Workspace, run: Path) -> None:
    reported = ReportedRun.open(RunFolder.open(run), toycar)
    panel = build_source_panel(reported)
    assert panel is not None
    page = Page(str(panel.html))
    assert not page.open
    line = at("wanted =")
    wanted = f"#q=line%3Dtoycar%2Fdriver.py%3A{line}"
    assert {wanted, f"{wanted}%20lasting%3Dpermanent", f"{wanted}%20lasting%3Dtransient"} <= set(page.links)
    assert "H 5/6" in page.texts
    assert f"| {DRIVER}:{line} |" in panel.markdown
    columns = {c["name"]: c for c in _list_table_data(reported, _listed_results(reported))["columns"]}
    assert f"{DRIVER}:{line}" in columns["line"]["words"]
    assert columns["lasting"]["words"] == ["permanent", "transient"]
    assert "1.2 * closing -> -(1.2 * closing)" in columns["value"]["words"]
    assert columns["variant"]["words"] == ["toycar/driver.py::Driver.drive"]


def test_the_score_equals_that_of_the_api(toycar: Workspace, run: Path) -> None:
    """Without golden runs, alerts are not compared."""
    loaded = load_run(run, workspace=toycar)
    totals = loaded.mutation_totals()
    assert totals.heads[:3] == ("mutation score", "number", "not activated")
    assert totals.rows[0][5] == "- (6/6)"  # a sample of mutants has no share
    assert [row[:3] for row in totals.rows] == [
        ("permanent mutants", "7", "1"),
        ("transient mutants", "7", "0"),
        ("all mutants", "7", "0"),
    ]
    frame = loaded.mutation_score().as_frame()
    line = frame[(frame["of"] == "arithmetic") & (frame["fault"] == "permanent")].iloc[0]
    assert (line["hazard: count"], line["hazard: of"], line["new alert"]) == (6, 6, None)


def test_the_source_of_a_changed_target_is_not_shown(toycar: Workspace, run: Path) -> None:
    path = toycar.library.parent / "tree" / DRIVER
    path.write_text("# one more line\n" + path.read_text())
    reported = ReportedRun.open(
        RunFolder.open(run), Workspace(library=toycar.library, templates=toycar.templates)
    )
    panel, score = build_source_panel(reported), build_mutation_score_panel(reported)
    assert panel is not None and score is not None
    assert "has changed since this run was planned" in panel.markdown
    assert "wanted" not in str(panel.html)
    assert "| arithmetic | mutants | permanent |" in score.markdown


def test_a_run_without_operators_has_no_source_view_and_no_score(
    toycar: Workspace, tmp_path: Path, write_run: Callable[..., Path]
) -> None:
    out = write_run(toycar, tmp_path / "run")
    table_building.build_tables(out)
    reported = ReportedRun.open(RunFolder.open(out), toycar)
    assert build_source_panel(reported) is None and build_mutation_score_panel(reported) is None
    assert not {"line", "lasting"} & {
        c["name"] for c in _list_table_data(reported, _listed_results(reported))["columns"]
    }
