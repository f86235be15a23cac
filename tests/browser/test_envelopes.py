"""The page of an exploration of the toy car: what is survived, in a sentence, a table and pictures."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import mutator
from mutator.report import experiment_list_data
from mutator.report.panels import figures_panel
from mutator.report.reported_run import ReportedRun
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace
from tests.browser.screens import on_each_screen

if TYPE_CHECKING:
    from tests.browser.conftest import Page

SPEC = "sensor/lane/shifted"


@pytest.fixture(scope="module")
def explored(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    place = tmp_path_factory.mktemp("explored")
    workspace = copy_toycar(place)
    mutator.envelope(
        SPEC,
        ["A", "B"],
        1.0,
        place / "run",
        points=4,
        longest_s=3.0,
        observe_s=0.5,
        validation=2,
        campaign="small",
        workspace=workspace,
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())  # no test looks at them
        mutator.load_run(place / "run", workspace=workspace).report()
    return place / "run"


@pytest.fixture
def page(open_report: Callable[[Path], "Page"], explored: Path) -> "Page":
    return open_report(explored)


def test_the_page_begins_with_what_is_survived(page: "Page", explored: Path) -> None:
    """The sentence, a row and a picture for each plane come before everything else, no shares of runs; the
    Markdown has sentence and table.
    """
    [sentence] = page.texts(".survived-sentence")
    assert SPEC in sentence and "first fails at" in sentence and "cells were driven" in sentence
    assert page.page.locator(".envelopes tbody tr").count() == page.page.locator("svg.plane").count() == 2
    top, after = (page.page.locator(name).bounding_box()["y"] for name in ("#survived", ".first-screen"))
    assert top < after and page.page.locator(".key-numbers").count() == 0
    assert "no share of them" in page.page.inner_text("#survived")
    markdown = (explored / "report" / "REPORT.md").read_text()
    words = "first fails at"
    assert markdown.index(words) < markdown.index("| fault | scenario |") < markdown.index("worst experiment")


def test_a_cell_opens_both_runs_of_the_border(page: "Page") -> None:
    """The link opens the run with the hazard, with the one without it beside it."""
    link = page.page.locator('.envelopes a[href*="with="]').first
    link.click()
    page.page.wait_for_selector("#experiment:not([hidden])")
    hazardous, beside = (part.partition("=")[2] for part in page.fragment.split("&"))
    assert hazardous in page.page.inner_text("#experiment")
    assert page.page.locator(".beside-row select").input_value() == beside


@on_each_screen
def test_it_reads_well_on_every_screen(
    page: "Page", serious_faults: Callable[[Any], list[str]], scheme: str, width: int
) -> None:
    """Nothing is wider than the window, pictures have a text alternative, and axe finds no serious fault."""
    page.page.emulate_media(color_scheme=scheme)
    page.page.set_viewport_size({"width": width, "height": 900})
    assert page.page.evaluate("document.documentElement.scrollWidth") <= width
    label = page.page.locator("svg.plane").first.get_attribute("aria-label")
    assert label and SPEC in label
    assert serious_faults(page.page) == []


def test_a_cut_list_keeps_what_the_table_links(explored: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of very many runs, the page lists the worst and those with links, so that each link opens its run."""
    monkeypatch.setattr(experiment_list_data, "_MOST_LISTED_OF_EXPLORATION", 2)
    run = ReportedRun.open(RunFolder.open(explored), Workspace.find(root=explored.parent / "toy"))
    content = experiment_list_data.build_list_data(run)
    assert run.explored and len(run.explored.linked_ids) > 2
    assert content.truncation_note.startswith("The list has the 2 worst, and those with links above, of ")
    listed = set(experiment_list_data._listed_results(run)["experiment_id"])
    assert run.explored.linked_ids <= listed and len(listed) < len(run.results)
