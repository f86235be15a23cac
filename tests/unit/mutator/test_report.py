"""The report of a run folder."""

import csv
import json
from html.parser import HTMLParser
from pathlib import Path

import pytest

from mutator import report
from mutator.columns import COLUMNS
from mutator.errors import MutatorError

HEAD = {
    "schema": "run/1",
    "campaign": "night_<b>drive</b>",
    "plan": "ab" * 32,
    "seed": 7,
    "reading": "as_described",
    "choices": {"seed": None, "limit": 3},
    "experiments": 3,
    "sources": {"target": "cd" * 32},
    "provenance": {
        "mutator": "0.1.0",
        "python": "3.11.7",
        "machine": "Linux",
        "packages": {"numpy": "2.4.6"},
    },
}
OK = {
    "module": "radar",
    "fault_type": "chaff",
    "variant": "distance",
    "value": "35",
    "unit": "m",
    "scenario": "S1",
    "method": "guided",
    "trigger": "C2",
    "status": "ok",
    "outcome": "hazard",
    "t_activation": "7.0",
    "t_manifest": "7.1",
    "h1": "1",
    "t_h1": "18.25",
    "h2": "0",
    "h3": "0",
}
NONE = {"outcome": "", "h1": "", "t_h1": "", "h2": "", "h3": ""}
BAD = OK | NONE | {"status": "harness_error", "detail": "the disk | is <gone>"}
CRASHED = OK | NONE | {"status": "crashed", "detail": "IndexError"}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A run folder with a hazard, a crash and a harness error; the hazard has its patch and plot."""
    (tmp_path / "run.json").write_text(json.dumps(HEAD))
    with (tmp_path / "results.csv").open("w", newline="") as file:
        table = csv.DictWriter(file, [*COLUMNS, "variant", "detail"], restval="")
        table.writeheader()
        for i, line in enumerate((OK, BAD, CRASHED)):
            table.writerow({"experiment_id": f"{i}" * 16} | line)
    for file in ("patches/00/" + "0" * 16 + ".patch", "plots/" + "0" * 16 + ".svg"):
        (tmp_path / file).parent.mkdir(parents=True)
        (tmp_path / file).touch()
    return tmp_path


class Page(HTMLParser):
    """Text and links of a page; fails on tags that are not closed in order."""

    VOID = ("meta", "link", "br", "img")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("href", "src")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data.strip())


def test_a_harness_error_is_a_class_of_its_own(run: Path) -> None:
    """It is listed first among the runs that ended badly, and is in no count of faults."""
    text = report.write(run).markdown.read_text()
    assert "3 experiments: 1 hazard, 1 crashed, 1 harness_error." in text
    failed = text.split("## Runs that did not end well")[1]
    assert failed.index("harness_error") < failed.index("crashed")
    assert "the disk \\| is <gone>" in failed
    counts = text.split("## By fault type")[1].split("##")[0]
    [line] = [line for line in counts.splitlines() if line.startswith("| radar/chaff ")]
    assert line == "| radar/chaff | 2 | 2 | 2 | 1 | 0 | 0 | 1 | 0 | 1 | 1 | 1 |"


def test_the_page_is_well_formed_and_escapes_what_it_shows(run: Path) -> None:
    """Every tag is closed, and text from specs and runs cannot become markup."""
    page = Page(report.write(run).page.read_text())
    assert page.open == []
    assert "night_<b>drive</b>" in page.texts
    assert "the disk | is <gone>" in page.texts


def test_the_page_links_what_is_there_and_nothing_else(run: Path) -> None:
    """Diff and plot of an experiment are linked when they exist; nothing comes from elsewhere."""
    written = report.write(run)
    page = Page(written.page.read_text())
    assert len(page.links) == 2
    assert all((written.page.parent / link).is_file() for link in page.links)
    assert "http" not in written.page.read_text()


def test_the_report_says_what_it_comes_from(run: Path) -> None:
    """Plan, seed, reading, choices, sources and versions are in both forms."""
    written = report.write(run)
    for text in (written.markdown.read_text(), written.page.read_text()):
        for fact in ("ab" * 32, "cd" * 32, "as_described", "chosen: limit", "3 of 3 planned", "2.4.6"):
            assert fact in text


def test_the_report_is_the_same_each_time(run: Path) -> None:
    """Written again from the same results, it is the same file."""
    written = report.write(run)
    before = written.page.read_bytes(), written.markdown.read_bytes()
    again = report.write(run)
    assert (again.page.read_bytes(), again.markdown.read_bytes()) == before


def test_the_tables_of_a_published_fault_type_stand_beside_the_papers(run: Path) -> None:
    """They are in the Markdown, in the page, and in files of their own."""
    written = report.write(run)
    cell = "35.6 % (154/432; 31.3 to 40.3)"
    files = [run / "report" / "tables" / f"coverage_guided.{kind}" for kind in ("md", "csv")]
    assert all(cell in file.read_text() for file in (written.markdown, written.page, files[0]))
    assert files[1].read_text().splitlines()[1].startswith("radar/chaff,paper,432,480,0.9,")


def test_no_report_without_a_run(tmp_path: Path) -> None:
    """A folder that is no run folder is the user's error."""
    with pytest.raises(MutatorError, match="no run folder"):
        report.write(tmp_path)


def test_figures_are_shown_where_there_is_something_to_compare(run: Path) -> None:
    """Two fault types and two scenarios: three figures, in the Markdown and the page, all of them there."""
    with (run / "results.csv").open("a", newline="") as file:
        other = OK | {"experiment_id": "3" * 16, "fault_type": "jamming", "scenario": "S2"}
        csv.DictWriter(file, [*COLUMNS, "variant", "detail"], restval="").writerow(other)
    written = report.write(run)
    shown = [link for link in Page(written.page.read_text()).links if link.startswith("figures/")]
    assert len(shown) == 6
    assert all((run / "report" / link).is_file() for link in shown)
    assert written.markdown.read_text().count("](figures/") == 3
