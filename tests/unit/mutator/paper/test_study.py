"""The study in the report of a campaign that asks for it."""

import csv
from pathlib import Path

import pytest

from mutator.report import building
from mutator.workspace import Workspace

from ..report.made_run import Page, make_run

HERE = Workspace.find(Path(__file__).parents[4])


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A made-up run whose campaign asks for the study."""
    return make_run(tmp_path, study="driving_agent_resilience")


def test_the_tables_of_a_published_fault_type_stand_beside_the_papers(run: Path) -> None:
    """They are in the Markdown, in the page, and in files of their own."""
    written = building.write(run, HERE)
    cell = "35.6 % (154/432; 31.3 to 40.3)"
    files = [run / "report" / "tables" / f"coverage_guided.{kind}" for kind in ("md", "csv")]
    assert all(cell in file.read_text() for file in (written.markdown, written.page, files[0]))
    assert files[1].read_text().splitlines()[1].startswith("radar/chaff,paper,432,480,0.9,")


def test_the_observations_have_a_file_a_table_and_a_place_in_both_forms(run: Path) -> None:
    """A claim's query stands in the file and in the page; the table has a line for each query."""
    written = building.write(run, HERE)
    file, table = run / "report/observations.md", run / "report/tables/observations.csv"
    query = "share(runs, of='method == \"guided\" and is_activated', part='not is_alert')"
    assert query in file.read_text()
    assert query in "".join(Page(written.page.read_text()).texts)
    assert "(observations.md)" in written.markdown.read_text()
    with table.open(newline="") as lines:
        assert query in [line["query"] for line in csv.DictReader(lines)]


def test_without_a_library_there_are_no_observations(run: Path) -> None:
    """A report can be written anywhere; what was published is then not in it."""
    written = building.write(run, None)
    assert "observation" not in written.markdown.read_text() + written.page.read_text()
    assert not (run / "report" / "observations.md").exists()


def test_a_figure_that_cannot_be_is_told_with_its_query(run: Path) -> None:
    """A hazard whose experiment is in no plan has no trace: both forms say so, none shows a picture."""
    written = building.write(run, HERE)
    for text in (written.markdown.read_text(), " ".join(Page(written.page.read_text()).texts)):
        assert "No figure: the traces it needs cannot be had" in text
        assert "t_h1 > t_activation" in text
    assert "action_" not in written.markdown.read_text()
    assert "<figure" not in written.page.read_text().replace('el("figure"', "")


def test_a_library_without_the_papers_numbers_is_said_in_the_origin(run: Path, toycar: Workspace) -> None:
    """Both forms name the study and say that its data are not there; the library that ships has them."""
    said = "the published numbers are not in this library"
    for workspace, expected in ((toycar, True), (HERE, False)):
        written = building.write(run, workspace)
        for text in (written.markdown.read_text(), written.page.read_text()):
            assert "driving_agent_resilience (Rubaiyat" in text
            assert (said in text) is expected
