"""Opening an experiment that did not end well, and closing an experiment."""

import shutil
from collections.abc import Callable
from pathlib import Path
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
def test_a_failed_experiment_shows_no_activation_and_no_replay_command(
    page: "Page", status: str, said: str
) -> None:
    """The page does not know whether the fault was activated."""
    page.open(f"status={status}")
    page.page.evaluate(WITHOUT_EVENTS)
    page.page.click(FIRST)
    page.page.wait_for_selector("#experiment .diff, #experiment .change p")
    text = page.page.inner_text("#experiment")
    assert "never active" not in text
    assert "--trace" not in text
    assert said in page.page.inner_text("#experiment .happened")


def test_a_missing_series_is_explained(
    open_report: Callable[[Path], "Page"], run: Path, tmp_path: Path
) -> None:
    """A page that was sent without its run folder says so; it does not say that there was no room."""
    (tmp_path / "sent").mkdir()
    shutil.copytree(run / "report", tmp_path / "sent" / "report")
    sent = open_report(tmp_path / "sent")
    sent.open("outcome=hazard")
    sent.page.click(FIRST)
    sent.page.wait_for_selector("#experiment .replay p:text('not next to this page')")
    sent.open("status=crashed")
    sent.page.click(FIRST)
    sent.page.wait_for_selector("#experiment .replay p:text('The run crashed')")
    assert all("ERR_FILE_NOT_FOUND" in error for error in sent.errors)  # the browser's note on the lost file
    sent.errors.clear()


def test_a_closed_experiment_is_removed_from_the_page(page: "Page") -> None:
    page.page.click(FIRST)
    page.page.wait_for_selector("#experiment .again")
    page.page.keyboard.press("Escape")
    page.page.wait_for_selector("#experiment", state="hidden")
    assert page.page.inner_html("#experiment") == ""


def test_arrow_keys_in_code_do_not_open_another_experiment(page: "Page") -> None:
    page.page.click(FIRST)
    page.page.focus("#experiment .spec pre")
    before = page.fragment
    page.page.keyboard.press("ArrowRight")
    assert page.fragment == before
