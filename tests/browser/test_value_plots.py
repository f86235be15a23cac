"""The part "Value and margin" of a report: from a mark to its experiment, and shares at a reaction time."""

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from .conftest import Page

RING = """() => {
    const { left, top, width, height } = document.querySelector('#value-plots .ring').getBoundingClientRect();
    return [left + width / 2, top + height / 2];
}"""


@pytest.fixture
def plots(page: "Page") -> Any:
    """The page, with the drawn plots in view."""
    assert not page.page.query_selector("#value-plots canvas"), "plots out of view cost no time"
    page.page.eval_on_selector("#values", "e => e.scrollIntoView()")
    page.page.wait_for_selector("#value-plots canvas")
    page.page.select_option("#plotted-measure", "time_to_hazard")
    return page.page


def opened_experiment(page: Any) -> str:
    page.wait_for_selector("#experiment .diff")
    return str(page.inner_text("#experiment .id code"))


def test_the_keyboard_moves_between_marks_and_opens_an_experiment(plots: Any) -> None:
    plots.focus(".stage-of-values")
    first = plots.inner_text("#value-plots .point")
    assert re.match(r"[-\d.]+ \w+ in \w+: time to hazard [\d.]+ s\. ", first)
    plots.keyboard.press("ArrowRight")
    second = plots.inner_text("#value-plots .point")
    assert second != first
    plots.keyboard.press("Home")
    assert plots.inner_text("#value-plots .point") == first
    plots.keyboard.press("End")
    plots.keyboard.press("ArrowRight")
    plots.keyboard.press("Enter")
    assert f"e={opened_experiment(plots)}" in plots.evaluate("location.hash")


def test_a_click_on_a_mark_opens_the_experiment_that_the_keys_choose_there(plots: Any) -> None:
    plots.focus(".stage-of-values")
    plots.keyboard.press("End")
    plots.keyboard.press("Enter")
    by_keyboard = opened_experiment(plots)
    plots.keyboard.press("Escape")
    assert plots.evaluate("document.activeElement.className").startswith("stage-of-values"), (
        "back where it was"
    )
    x, y = plots.evaluate(RING)
    plots.evaluate("document.activeElement.blur()")
    plots.mouse.move(x + 3, y)
    assert not plots.is_hidden("#value-plots .ring")
    plots.mouse.click(x + 3, y)
    assert opened_experiment(plots) == by_keyboard


def test_a_click_beside_all_marks_opens_nothing(plots: Any) -> None:
    box = plots.query_selector(".stage-of-values").bounding_box()
    plots.mouse.click(box["x"] + 4, box["y"] + box["height"] - 4)
    assert plots.is_hidden("#experiment")


def test_the_hazards_within_a_reaction_time_are_read_off_in_words(plots: Any) -> None:
    plots.fill("#reaction-time", "2.5")
    plots.press("#reaction-time", "Enter")
    text = plots.inner_text("#value-plots .reading")
    assert re.match(r"Within 2\.5 s of the activation come \d+ of \d+ hazards of all faults", text)
    assert "%" not in text  # the campaign is an even sample
    assert "react=2.5" in plots.evaluate("location.hash")
    plots.fill("#reaction-time", "0")
    plots.press("#reaction-time", "Enter")
    assert re.search(r"come 0 of \d+ hazards", plots.inner_text("#value-plots .reading"))
    plots.reload()
    plots.wait_for_selector("html[data-ready]")
    plots.eval_on_selector("#values", "e => e.scrollIntoView()")
    assert plots.wait_for_selector("#reaction-time").input_value() == "0"


def test_the_table_has_the_same_points_and_opens_them(plots: Any) -> None:
    plots.click("#value-plots .as-table summary")
    plots.wait_for_selector("#value-plots .as-table button")  # the browser opens the table after the click
    buttons = plots.query_selector_all("#value-plots .as-table button")
    count = int(plots.inner_text("#value-plots figure:first-of-type > p").split()[0])
    assert len(buttons) == count > 1
    buttons[0].click()
    assert opened_experiment(plots)


@pytest.mark.parametrize("width", [1440, pytest.param(400, marks=pytest.mark.slow)])
def test_the_plots_have_no_serious_fault_on_any_screen(
    plots: Any, serious_faults: Callable[[Any], list[str]], width: int
) -> None:
    plots.set_viewport_size({"width": width, "height": 900})
    plots.click("#value-plots .as-table summary")
    for scheme in ("light", "dark"):
        plots.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert serious_faults(plots) == []
    assert plots.evaluate("document.documentElement.scrollWidth") == width
