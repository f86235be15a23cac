"""Two experiments of a report over each other in the plots of a replay."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from mutator.campaigns.plan import load_plan
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    from .conftest import Page

PICKER = "#experiment select[aria-label='Compare with']"
# whether a plot has pixels of the colour of the other experiment's line
HAS_LINE = """() => {
    const canvas = document.querySelector('#experiment .plot-of canvas'), { width, height } = canvas;
    // a copy, because Chromium remarks on repeated readings of a canvas that it draws by the GPU
    const context = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, width, height);
    const isLine = (i) => data[i] === 0x6a && data[i + 1] === 0x3f && data[i + 2] === 0xb5;
    return Array.from({ length: width * height }, (_, i) => 4 * i).some(isLine);
}"""


def opened(page: "Page", fragment: str) -> Any:
    page.open(fragment)
    page.page.wait_for_selector("#experiment .plot-of canvas")
    return page.page


@pytest.fixture
def ids(run: Path) -> list[str]:
    """The ids of the experiments of the run that have series, which it plans second and third."""
    return [experiment.id for experiment in load_plan(RunFolder.open(run)).experiments[1:3]]


def test_another_experiment_lies_over_the_plots_and_golden_stays(
    page: "Page", ids: list[str], serious_faults: Callable[[Any], list[str]]
) -> None:
    shown = opened(page, f"e={ids[0]}")
    assert not shown.evaluate(HAS_LINE)
    t = shown.get_attribute("#experiment .replay-player", "data-t")
    shown.focus(PICKER)
    shown.select_option(PICKER, ids[1])
    shown.wait_for_selector("#experiment .plots .key.beside")
    shown.wait_for_function(HAS_LINE)
    legend = shown.inner_text("#experiment .plots .legend")
    assert legend.startswith("golden") and "faulty" in legend
    assert shown.inner_text("#experiment .plot-of .value.beside")
    assert shown.get_attribute("#experiment .replay-player", "data-t") == t
    for scheme in ("light", "dark"):
        shown.emulate_media(color_scheme=scheme, reduced_motion="reduce")
        assert serious_faults(shown) == []
    assert f"with={ids[1]}" in page.fragment
    shown.reload()
    shown.wait_for_selector("#experiment .plots .key.beside")
    shown.select_option(PICKER, "")
    shown.wait_for_selector("#experiment .plots .key.beside", state="detached")
    assert "with=" not in page.fragment


def test_the_spoken_state_names_both_experiments(page: "Page", ids: list[str]) -> None:
    shown = opened(page, f"e={ids[0]}&with={ids[1]}")
    shown.wait_for_selector("#experiment .plots .key.beside")
    name = shown.inner_text(f"{PICKER} option:checked")
    shown.focus("#experiment .timebar")
    shown.keyboard.press("End")
    shown.wait_for_function(
        "name => document.querySelector('#experiment .timebar').ariaValueText.includes(name)", arg=name
    )
    assert name in shown.get_attribute("#experiment .plot-of canvas", "aria-label")


def test_an_experiment_without_a_series_says_so(page: "Page", ids: list[str]) -> None:
    shown = opened(page, f"e={ids[0]}")
    others = shown.eval_on_selector_all(f"{PICKER} option", "all => all.map((o) => o.value).filter(Boolean)")
    missing = next(name for name in others if name != ids[1])
    shown.select_option(PICKER, missing)
    shown.wait_for_selector("text=There is no series of that experiment")
    assert shown.locator("#experiment .plots .key.beside").count() == 0


def test_another_opened_experiment_is_not_compared(page: "Page", ids: list[str]) -> None:
    shown = opened(page, f"e={ids[0]}&with={ids[1]}")
    shown.wait_for_selector("#experiment .plots .key.beside")
    shown.keyboard.press("j")
    shown.wait_for_function("!location.hash.includes('with=')")
