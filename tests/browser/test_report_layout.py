"""The report page on any screen, in both colour schemes, and on paper."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .conftest import Page

EXPERIMENTS = 24  # in the run


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_narrow_screen_does_not_scroll_sideways(browser: Any, run: Path, scheme: str) -> None:
    context = browser.new_context(viewport={"width": 400, "height": 800}, color_scheme=scheme)
    page = context.new_page()
    page.goto((run / "report" / "index.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    width = "document.documentElement.scrollWidth"
    assert page.evaluate(width) == 400
    assert page.evaluate("document.querySelector('#grid td').clientWidth") > 150  # wide enough for its text
    page.eval_on_selector_all(
        "#heat .cell", "all => all.forEach((c) => (c.textContent = '123456789/987654321'))"
    )
    # wide enough for the names of rows
    assert page.evaluate("document.querySelector('#heat th[scope=row]').clientWidth") > 70
    assert page.evaluate(width) == 400
    page.click("#grid tr[data-at] >> nth=0")
    page.wait_for_selector("#experiment .diff")
    assert page.evaluate("document.querySelector('#experiment').clientWidth") == 400
    assert page.evaluate("document.querySelector('#experiment').scrollWidth") == 400
    page.eval_on_selector("#experiment .events td:last-child", "td => (td.textContent = 'alert'.repeat(20))")
    assert page.evaluate("document.querySelector('#experiment').scrollWidth") == 400
    context.close()


@pytest.mark.parametrize("width", [1000, 1440])
def test_value_and_trigger_stay_visible_beside_an_opened_experiment(page: "Page", width: int) -> None:
    page.page.set_viewport_size({"width": width, "height": 900})
    page.page.click("#grid tr[data-at] >> nth=1")
    page.page.wait_for_selector("#experiment .diff")
    box = page.page.locator("#grid").bounding_box()
    for name in ("kind", "value", "trigger", "ending"):
        cell = page.page.locator(f'#grid th[data-column="{name}"]').bounding_box()
        assert cell["x"] >= box["x"] and cell["x"] + cell["width"] <= box["x"] + box["width"] + 1
        assert cell["width"] > 50
    assert any(page.column("value")) and all(page.column("trigger"))


TITLES = """[...document.querySelectorAll("h1")].filter((h) => h.checkVisibility() && !h.closest("[inert]"))
    .map((h) => h.textContent)"""


@pytest.mark.parametrize("width", [1440, pytest.param(400, marks=pytest.mark.slow)])
def test_axe_finds_no_serious_fault(
    page: "Page", serious_faults: "Callable[[Any], list[str]]", width: int
) -> None:
    page.page.set_viewport_size({"width": width, "height": 900})
    for scheme in ("light", "dark"):
        page.page.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert serious_faults(page.page) == []
        page.page.evaluate("document.querySelector('#grid tr[data-at]').click()")
        page.page.wait_for_selector("#experiment .diff")
        assert serious_faults(page.page) == []
        assert page.page.evaluate(TITLES) == ["Experiment from toy"]
        page.page.keyboard.press("Escape")
        assert page.page.evaluate(TITLES) == ["toy"]


def test_column_titles_are_not_cut_off(page: "Page") -> None:
    cut = "all => all.filter((b) => b.scrollWidth > b.clientWidth).map((b) => b.textContent)"
    assert page.page.eval_on_selector_all("#grid thead button", cut) == []
    page.page.evaluate("document.querySelector('#grid').style.setProperty('--rows', 3)")
    assert page.page.evaluate("document.querySelector('#grid').clientHeight") < 32 + 5 * 30


# A low window, scrolled to the middle; paper gets five rows.
SCROLLED = """() => {
    const grid = document.querySelector('#grid');
    Grid.PRINTED = 5;
    grid.style.setProperty('--rows', 1);
    grid.scrollTop = 300;
}"""
FIRST_ROW = "Number(document.querySelector('#grid tr[data-at]').dataset.at)"


@pytest.fixture
def scrolled(page: "Page") -> Iterator["Page"]:
    page.page.evaluate(SCROLLED)
    page.page.wait_for_function(f"{FIRST_ROW} === 2")
    yield page


def test_the_printed_page_has_rows_up_to_a_limit(page: "Page") -> None:
    page.page.emulate_media(media="print")
    page.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert len(page.column("experiment_id")) == EXPERIMENTS
    assert not page.page.is_visible("#facets")
    page.page.evaluate("dispatchEvent(new Event('afterprint'))")
    page.page.evaluate("Grid.PRINTED = 10")
    page.page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.texts("#grid tbody tr")[10:] == ["and 14 more (not printed)"]


@pytest.mark.parametrize("due", ["grid.scrollTop = 310", "grid.style.height = '200px'"])
def test_the_printed_page_has_the_first_rows_after_a_late_redraw(scrolled: "Page", due: str) -> None:
    printing = f"""async () => {{
        const frame = () => new Promise(requestAnimationFrame), grid = document.querySelector('#grid');
        {due};
        dispatchEvent(new Event('beforeprint'));
        for (let k = 0; k < 4; k++) await frame();
        return [...grid.querySelectorAll('tr[data-at]')].map((tr) => Number(tr.dataset.at));
    }}"""
    assert scrolled.page.evaluate(printing) == list(range(5))


def test_printing_the_first_rows_restores_the_screen(scrolled: "Page") -> None:
    page = scrolled.page
    page.evaluate("document.querySelector('#grid').hidden = true")
    others = rows_of(page.pdf(tagged=True))
    page.evaluate("document.querySelector('#grid').hidden = false")
    page.evaluate("document.querySelector('#grid').scrollTop = 310")
    assert rows_of(page.pdf(tagged=True)) - others == 7  # includes the heading and the note on omitted rows
    assert page.evaluate(FIRST_ROW) == 2
    assert page.evaluate("document.querySelector('#grid').scrollTop") == 310


def rows_of(pdf: bytes) -> int:
    return len(re.findall(rb"/S\s*/TR\b", pdf))
