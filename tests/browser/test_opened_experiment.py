"""An opened experiment: what is said of one that did not end well, and what closing it ends."""

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from .conftest import Page

FIRST = "#grid tr[data-at]"


WITHOUT_EVENTS = """() => {
    const number = Rows.Table.prototype.number;
    Rows.Table.prototype.number = function (row, name) {
        return name.startsWith("t_") ? NaN : number.call(this, row, name);
    };
}"""


@pytest.mark.parametrize(
    ("status", "said"), [("harness_error", "The harness failed"), ("crashed", "No event was")]
)
def test_of_an_experiment_that_did_not_end_well_nothing_is_made_up(
    page: "Page", status: str, said: str
) -> None:
    """Neither that its fault was never active, nor that a command would drive it again for a replay."""
    page.open(f"status={status}")
    page.page.evaluate(WITHOUT_EVENTS)
    page.page.click(FIRST)
    page.page.wait_for_selector("#experiment .diff, #experiment .change p")
    text = page.page.inner_text("#experiment")
    assert "never active" not in text
    assert "--trace" not in text
    assert said in page.page.inner_text("#experiment .happened")


def test_a_closed_experiment_leaves_nothing_behind(page: "Page") -> None:
    """Its replay would play on where nobody sees it."""
    page.page.click(FIRST)
    page.page.wait_for_selector("#experiment .again")
    page.page.keyboard.press("Escape")
    page.page.wait_for_selector("#experiment", state="hidden")
    assert page.page.inner_html("#experiment") == ""


def test_arrows_in_code_scroll_the_code(page: "Page") -> None:
    """They do not go on to another experiment, as nothing says that they would."""
    page.page.click(FIRST)
    page.page.focus("#experiment .spec pre")
    before = page.fragment
    page.page.keyboard.press("ArrowRight")
    assert page.fragment == before
