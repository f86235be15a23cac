"""The review page in the browser."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.review.mutant_groups import groups_of_library
from mutator.review.review_page import write_review_page
from mutator.review.review_state_and_actions import ReviewAction, ReviewActionKind, record_actions
from mutator.workspace import Workspace


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    """A page of the toy's five groups, one of which is approved."""
    folder = tmp_path_factory.mktemp("review")
    toy = copy_toycar(folder)
    groups = groups_of_library(toy, toy.manifest("toycar"), specs=["sensor/*"])
    approval = ReviewAction(group=groups[-1], kind=ReviewActionKind.APPROVE, by="Jane <b>Doe</b>")
    review = record_actions(toy, "toycar", [approval], {})
    write_review_page(folder / "review.html", review, review.in_list_order(groups), ["--spec", "sensor/*"])
    return folder / "review.html"


@pytest.fixture
def open_page(browser: Any, file: Path) -> Iterator[Callable[..., Any]]:
    errors: list[str] = []
    contexts = []

    def opened(fragment: str = "", **options: Any) -> Any:
        contexts.append(browser.new_context(**options))
        page = contexts[-1].new_page()
        page.on("console", lambda m: errors.append(m.text) if m.type in ("error", "warning") else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(f"{file.as_uri()}#{fragment}")
        page.wait_for_selector("html[data-ready]")
        return page

    yield opened
    for context in contexts:
        context.close()
    assert errors == []


def shown(page: Any) -> int:
    return int(page.locator(".group:visible").count())


def unfold(page: Any) -> None:
    closed = page.locator("[data-do=unfold][aria-expanded=false]:visible")
    while closed.count():
        closed.first.click()


def test_filters_narrow_the_list_and_are_in_the_address(open_page: Callable[..., Any]) -> None:
    page = open_page()
    unfold(page)
    assert (shown(page), page.inner_text("#found")) == (5, "5 groups")
    page.fill("#find", "omission")
    assert (shown(page), page.inner_text("#found")) == (1, "1 of 5 groups")
    page.fill("#find", "")
    page.click("[data-state=approved]")
    assert "approved by Jane <b>Doe</b>" in page.inner_text(".group:visible")
    page.click("#split")
    again = open_page(page.url.partition("#")[2])
    assert shown(again) == 1
    assert again.locator(".group:visible .diff.split").count() == 1


def test_marks_become_commands(open_page: Callable[..., Any]) -> None:
    page = open_page("q=gap")
    unfold(page)
    for key in "jajr":
        page.keyboard.press(key)
    page.fill("#by", "Jane O'Neil")
    page.fill("#remark", "fine")
    page.fill("#reason", "too large")
    ids = page.locator(".group:visible h2").all_inner_texts()
    said = "--spec 'sensor/*' --by 'Jane O'\\''Neil' --remark fine"
    assert page.locator("#commands code").all_inner_texts() == [
        f"mutator review approve {ids[0]} {said}",
        f"mutator review reject {ids[1]} {said} --reason 'too large'",
    ]
    page.keyboard.press("Escape")
    page.keyboard.press("r")
    assert page.locator("#commands code").count() == 1


def test_similar_groups_are_folded(open_page: Callable[..., Any]) -> None:
    page = open_page("q=gap")
    assert shown(page) == 1
    assert page.inner_text("[data-do=unfold]:visible") == "1 more like this"
    page.keyboard.press("j")
    page.keyboard.press("s")
    assert page.inner_text("#ask-title") == "Approve 2 groups?"
    assert "1 of them is folded" in page.inner_text("#ask-about")
    page.keyboard.press("Enter")
    assert page.inner_text("#commands code").count(" ") == 2 + 2 + 2 + 2  # verb, ids, --spec, --by
    page.keyboard.press("o")
    assert shown(page) == 2
    assert page.locator("[data-mark=approve][aria-pressed=true]:visible").count() == 2


def test_all_filtered_groups_are_marked_after_confirmation(open_page: Callable[..., Any]) -> None:
    page = open_page("q=gap")
    page.keyboard.press("Shift+R")
    assert page.inner_text("#ask-title") == "Reject 2 groups?"
    page.keyboard.press("Escape")
    assert not page.is_visible("#commands")
    page.click("#reject-shown")
    page.click("#ask-yes")
    assert page.inner_text("#commands code").startswith("mutator review reject ")


def test_a_diff_shows_its_holes_and_their_values(open_page: Callable[..., Any]) -> None:
    page = open_page("q=longer")
    page.keyboard.press("j")
    assert page.locator(".group:visible mark.hole").all_inner_texts() == ["⟨by⟩"]
    page.keyboard.press("v")
    assert page.locator(".group:visible .values tbody tr:visible").count() == 8
    summary = page.inner_text(".group:visible .values summary")
    assert summary.startswith("Values (8): by + ") and summary.endswith(" m")
    assert "by (m)" in page.locator(".group:visible .values th").all_inner_texts()


def test_a_title_says_what_the_faults_are(open_page: Callable[..., Any]) -> None:
    """The sentence of the spec stands above the place, and the search finds it."""
    page = open_page("q=further away")
    title = page.inner_text(".group:visible .about")
    assert re.fullmatch(r"sensor/distance/longer \d+ to \d+\sm: The other car seems further away\.", title)


def test_wide_content_scrolls_in_its_own_box(open_page: Callable[..., Any]) -> None:
    page = open_page(viewport={"width": 400, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") == 400


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_serious_fault(
    open_page: Callable[..., Any], serious_faults: Callable[[Any], list[str]], scheme: str
) -> None:
    page = open_page(color_scheme=scheme, reduced_motion="reduce")
    assert serious_faults(page) == []
