"""The source view of a run with mutation operators."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from mutator.model import Experiment, Outcome
from mutator.report import report_builder
from mutator.report.panels import figures_panel
from mutator.results import table_building
from mutator.workspace import Workspace

if TYPE_CHECKING:
    from .conftest import Page

HAZARD = {"outcome": Outcome.HAZARD, "hazards": (("H3", 4.0),), "t_manifest": 2.5}


def result_of(experiment: Experiment) -> dict[str, Any]:
    return HAZARD if experiment.trigger.name == "always" else {}


@pytest.fixture(scope="module")
def report(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    write_run: Callable[..., Path],
    of_operators: Callable[..., Any],
) -> Path:
    folder = tmp_path_factory.mktemp("source")
    workspace = copy_toycar(folder)
    out = write_run(workspace, folder / "run", result_of, changed=of_operators(workspace, "toycar/driver.py"))
    table_building.build_tables(out)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())
        report_builder.write_report(out, workspace)
    return out


def test_a_mark_lists_its_experiments(
    report: Path, open_report: "Callable[[Path], Page]", serious_faults: Callable[[Any], list[str]]
) -> None:
    page = open_report(report)
    assert serious_faults(page.page) == []
    line = page.page.locator(".source tr", has_text="gas = min")
    assert line.locator(".mark").all_inner_texts() == ["H 1/1", "M 1/1"]
    for link, ending in ((".mark.hazard a", "hazard"), (".mark.masked a", "masked")):
        line.locator(link).focus()
        page.page.keyboard.press("Enter")
        page.wait_for_rows(1)
        assert page.column("ending") == [ending]
    line.locator(".no a").click()
    page.wait_for_rows(2)
    assert page.found == "2 of 18 experiments"
    page.page.click("#grid tr[data-at]")
    page.page.wait_for_selector("#experiment .pictures .command")
    verbs = {one.split()[1] for one in page.texts("#experiment .command code")}
    assert verbs == {"report", "rerun", "show"}  # `try` needs a spec, and no spec has this mutant


def test_the_source_fits_a_narrow_screen(report: Path, open_report: "Callable[[Path], Page]") -> None:
    page = open_report(report).page
    page.set_viewport_size({"width": 390, "height": 800})
    page.emulate_media(color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    mark = page.locator(".source .mark.hazard a").first.bounding_box()
    assert mark is not None and mark["x"] + mark["width"] < 200
