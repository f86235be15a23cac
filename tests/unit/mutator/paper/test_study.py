"""The study in the report of a campaign that requests it."""

import csv
from pathlib import Path

import pytest

from mutator.report import report_builder
from mutator.workspace import Workspace
from tests.made_up_results import write_results

from ..report.made_run import COLUMNS, LINES, OK, Page, make_run

HERE = Workspace.find(Path(__file__).parents[4])


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A made-up run of a campaign that requests the study. One hazard contradicts the second observation."""
    made = make_run(tmp_path, study="driving_agent_resilience", experiments=4)
    kind = {"module": "vision_output", "fault_type": "relative_distance", "fault_id": "f4"}
    write_results(made, COLUMNS, [*LINES, OK | kind | {"experiment_id": "4" * 16}])
    return made


def study_forms(run: Path) -> tuple[str, str]:
    """Return the study's Markdown and the text of its page."""
    report_builder.write_report(run, HERE)
    report = run / "report"
    return (report / "STUDY.md").read_text(), " ".join(Page((report / "study.html").read_text()).texts)


def test_tables_of_the_study_are_not_in_the_main_report(run: Path) -> None:
    forms = study_forms(run)
    cell = "35.6 % (154/432; 31.3 to 40.3)"
    files = [run / "report" / "tables" / f"coverage_guided.{kind}" for kind in ("md", "csv")]
    assert all(cell in text for text in (*forms, files[0].read_text()))
    assert not any(cell in (run / "report" / name).read_text() for name in ("REPORT.md", "index.html"))
    assert files[1].read_text().splitlines()[1].startswith("radar/chaff,paper,432,480,0.9,")


def test_the_observations_are_in_a_file_a_table_the_markdown_and_the_page(run: Path) -> None:
    text, page = study_forms(run)
    file, table = run / "report/observations.md", run / "report/tables/observations.csv"
    query = "share(runs, of='method == \"guided\" and is_activated', part='not is_alert')"
    assert query in file.read_text()
    assert query in page
    assert "(observations.md)" in text
    with table.open(newline="") as lines:
        assert query in [line["query"] for line in csv.DictReader(lines)]


def test_without_a_library_there_are_no_observations(run: Path) -> None:
    written = report_builder.write_report(run, None)
    assert "observation" not in written.markdown.read_text() + written.page.read_text()
    assert not (run / "report" / "observations.md").exists()


def test_the_report_links_to_the_page_of_the_study(run: Path) -> None:
    written = report_builder.write_report(run, HERE)
    assert "[STUDY.md](STUDY.md)" in written.markdown.read_text()
    assert "study.html" in Page(written.page.read_text()).links
    write_results(run, COLUMNS, LINES)
    written = report_builder.write_report(run, HERE)
    assert "STUDY.md" not in written.markdown.read_text()
    assert "study.html" not in Page(written.page.read_text()).links
    assert not (run / "report" / "study.html").exists()
    assert "these results cannot be compared with it" in written.markdown.read_text()


def test_an_experiment_outside_the_plan_has_no_figure(run: Path) -> None:
    forms = study_forms(run)
    for text in forms:
        assert "No figure: the traces are not available" in text
        assert "t_h1 > t_activation" in text
    assert "action_" not in forms[0]
    assert "<figure" not in (run / "report" / "study.html").read_text()


def test_the_origin_says_which_data_of_the_paper_are_missing(run: Path, toycar: Workspace) -> None:
    said = "the published numbers are not in this library"
    for workspace, expected in ((toycar, True), (HERE, False)):
        written = report_builder.write_report(run, workspace)
        for text in (written.markdown.read_text(), written.page.with_name("origin.html").read_text()):
            assert "driving_agent_resilience (Rubaiyat" in text
            assert (said in text) is expected
