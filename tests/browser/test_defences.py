"""What became of experiments with sets of defences, on a page with made-up sets."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from mutator.comparison.compared_runs import ComparedRun, load_compared_run
from mutator.comparison.defended_pairs import DefendedRow, pair_of
from mutator.comparison.defended_sets import DefendedSet
from mutator.comparison.run_comparison_and_gates import compare_loaded_runs
from mutator.report import report_builder, reported_run
from mutator.report.panels import figures_panel
from mutator.report.reported_sets import ReportedSet

if TYPE_CHECKING:
    from .conftest import Page

SETS = ("brake", "driver+brake", *(f"other_{number}" for number in range(6)))
MARK = "#grid tbody .fate"


def made_set(run: ComparedRun, name: str) -> ReportedSet:
    """The first set saves all, the second replaces hazards and causes some, and the others change nothing."""
    rows = dict(run.row_by_id)
    for key, row in rows.items():
        if row.hazards and name == "brake":
            rows[key] = replace(row, hazards=())
        elif name == "driver+brake" and row.ending in ("hazard", "sdc"):
            rows[key] = replace(row, hazards=(("H1", 3.0),))
    facts = DefendedRow(
        acted=("brake",),
        first_acted_s=2.5,
        conflict_steps=0,
        after_fault_s=99.0,
        end_speed=9.0,
        driver_at_end=False,
        authority={"brake": 1.0},
    )
    defended = replace(run, row_by_id=rows)
    return ReportedSet(
        defended=DefendedSet(
            name=name,
            undefended=run,
            defended=defended,
            pairs=tuple(pair_of(run.row_by_id[key], rows[key], facts, 15.0) for key in rows),
            golden_activities=(),
            caused_goldens=(),
        ),
        comparison=compare_loaded_runs(run, defended, scenes=(None, None)),
    )


@pytest.fixture(scope="module")
def defended(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = shutil.copytree(run, tmp_path_factory.mktemp("defended") / "run")
    compared = load_compared_run(copy)
    sets = tuple(made_set(compared, name) for name in SETS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        patch.setattr(reported_run, "load_reported_sets", lambda folder, manifest: sets)
        report_builder.write_report(copy, None, single_file=True)
    return copy


def test_a_row_has_a_mark_for_each_set(
    defended: Path, open_report: "Callable[[Path], Page]", serious_faults: Callable[[Any], list[str]]
) -> None:
    """All are seen at 1400 px; a mark says more when pointed at, and a line below the list explains it."""
    page = open_report(defended)
    assert page.page.locator(MARK).count() == len(SETS) * page.page.locator("#grid tr[data-at]").count()
    hazard = page.page.locator("#grid tr[data-at]", has_text="hazard").first
    assert hazard.locator(".fate").all_inner_texts() == ["P", "R", *"UUUUUU"]
    title = hazard.locator(".fate").nth(1).get_attribute("title")
    assert title and title.startswith("driver+brake: replaced by H1 (another hazard instead")
    room = page.page.locator("#grid").bounding_box()
    last = hazard.locator(".fate").last.bounding_box()
    assert room and last and last["x"] + last["width"] < room["x"] + room["width"]
    assert "P prevented, O open, R replaced" in page.page.inner_text(".under-list")
    assert serious_faults(page.page) == []


def test_sets_are_filters_and_columns(defended: Path, open_report: "Callable[[Path], Page]") -> None:
    """A filter finds what a set caused; each set is a column that can be chosen and searched."""
    page = open_report(defended)
    page.choose("with_defences", "driver+brake: caused H1")
    assert {"sdc"} == {*page.column("ending")}
    page.open("cols=experiment_id,with_driver_and_brake&q=with_brake%3Dprevented")
    fates = page.column("with_driver_and_brake")
    assert fates and {*fates} == {"replaced by H1"}


def test_an_opened_experiment_shows_all_sets_and_links_to_both_drives(
    defended: Path, open_report: "Callable[[Path], Page]"
) -> None:
    """Only where the pair is on the set's page, which opens it."""
    page = open_report(defended)
    page.page.locator("#grid tr[data-at]", has_text="hazard").first.click()
    page.page.wait_for_selector("section.defended")
    assert page.texts("section.defended tbody th") == [*SETS]
    assert page.texts("section.defended tbody .fate")[:3] == ["prevented", "replaced by H1", "unchanged"]
    assert page.texts("section.defended tbody td:nth-child(3)")[0] == "brake, first at 2.50 s"
    links = page.page.locator("section.defended a")
    assert links.count() == 2
    name = page.page.locator("#experiment .id code").inner_text()
    links.nth(1).click()
    page.page.wait_for_selector("#pair h3")
    assert page.page.url.endswith(f"/defended/driver%2Bbrake/index.html#q={name}")
    assert name in page.page.inner_text("#pair")


def test_a_page_that_lies_alone_has_no_links_to_pairs(
    defended: Path, open_report: "Callable[[Path], Page]"
) -> None:
    page = open_report(defended)
    page.url = next((defended / "exports").glob("*.html")).as_uri()
    page.open()
    page.page.locator("#grid tr[data-at]", has_text="hazard").first.click()
    page.page.wait_for_selector("section.defended")
    assert page.page.locator("section.defended a").count() == 0
