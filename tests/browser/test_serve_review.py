"""A server's review page keeps its marks if other reviewers write or the server fails."""

from collections.abc import Callable, Iterator
from pathlib import Path
from shutil import rmtree
from typing import Any

import pytest

from mutator.review.review_state_and_actions import load_review
from mutator.workspace import Workspace

Visit = Callable[..., Any]
ADDRESS = "/review/toycar?spec=sensor/*"


@pytest.fixture(scope="module")
def library(
    tmp_path_factory: pytest.TempPathFactory,
    copy_toycar: Callable[[Path], Workspace],
    give_eyes: Callable[..., None],
) -> Workspace:
    """The toy's library with an image effect, which gives six groups."""
    toy = copy_toycar(tmp_path_factory.mktemp("served"))
    give_eyes(toy)
    return toy


@pytest.fixture(scope="module")
def address(library: Workspace, serve: Callable[..., Any]) -> Iterator[str]:
    with serve(library) as found:
        yield found


@pytest.fixture
def review(address: str, library: Workspace, visit: Visit) -> Callable[..., Any]:
    """Open the page as a reviewer. No group has a mark yet."""
    rmtree(library.library / "reviews", ignore_errors=True)

    def opened(by: str, fragment: str = "", **options: Any) -> Any:
        page = visit(address, f"{ADDRESS}#{fragment}", **options)
        ready(page)
        page.fill("#by", by)
        page.keyboard.press("Escape")
        return page

    return opened


def ready(page: Any) -> None:
    page.wait_for_selector("html[data-ready]", state="attached")


def intercept(page: Any, handler: Callable[[Any], None]) -> None:
    """Pass the page's requests to `handler`. A page loaded before can still send some past it."""
    page.route("**/api/review/**", handler)
    page.reload()
    ready(page)


def saved(page: Any, group: str) -> None:
    page.wait_for_selector(f"#group-{group} .kept:text('saved')")


def current(page: Any) -> str:
    return str(page.get_attribute(".group[aria-current]", "id")).removeprefix("group-")


def words(page: Any, group: str) -> str:
    return str(page.inner_text(f"#group-{group}"))


def test_marks_survive_a_reload(review: Callable[..., Any], library: Workspace) -> None:
    page = review("Jane <b>Doe</b>")
    for key in "jjaf":
        page.keyboard.press(key)
    group = current(page)
    page.keyboard.press("c")
    page.keyboard.type("<i>limits</i> are right")
    page.keyboard.press("Enter")
    saved(page, group)
    page.reload()
    ready(page)
    text = words(page, group)
    assert "approved by Jane <b>Doe</b>" in text
    assert "<i>limits</i> are right" in text
    assert "flagged" in text
    assert page.inner_text("[data-state=approved]") == "approved 1"
    kept = load_review(library, "toycar")
    decision, flag = kept.decision(group), kept.flag(group)
    assert decision is not None
    assert (decision.verdict, decision.by) == ("approved", "Jane <b>Doe</b>")
    assert flag is not None
    assert [remark.text for remark in kept.remarks(group)] == ["<i>limits</i> are right"]


def test_a_decision_and_a_flag_can_be_withdrawn(review: Callable[..., Any], library: Workspace) -> None:
    page = review("Jane")
    page.keyboard.press("j")
    for key in "rffu":
        page.keyboard.press(key)
        page.wait_for_timeout(50)
    page.wait_for_selector("[data-state=new]:text('new 6')")
    saved(page, current(page))
    assert not load_review(library, "toycar").entry_by_group


def test_a_rejection_has_a_reason(review: Callable[..., Any], library: Workspace) -> None:
    page = review("Jane")
    page.keyboard.press("j")
    group = current(page)
    page.keyboard.press("r")
    saved(page, group)
    for reason in ("too <b>large</b>", "never left out"):
        page.fill(f"#group-{group} .remark input", reason)
        page.click(f"#group-{group} button:text('Reject for this reason')")
        page.wait_for_selector(f"#group-{group} .decision:text({reason!r})")
        saved(page, group)
    kept = load_review(library, "toycar")
    decision = kept.decision(group)
    assert decision is not None
    assert (decision.verdict, decision.reason, kept.remarks(group)) == ("rejected", "never left out", ())


def test_a_decision_needs_a_name(review: Callable[..., Any], library: Workspace) -> None:
    page = review("")
    page.keyboard.press("j")
    page.keyboard.press("a")
    assert page.evaluate("document.activeElement.id") == "by"
    assert not load_review(library, "toycar").entry_by_group


def test_reviewers_do_not_overwrite_decisions_that_they_have_not_seen(
    review: Callable[..., Any], library: Workspace
) -> None:
    first, second = review("Jane"), review("Jim")
    for page in (first, second):
        page.keyboard.press("j")
    group = current(first)
    first.keyboard.press("a")
    saved(first, group)
    second.keyboard.press("r")
    second.wait_for_selector(f"#group-{group} .conflict:visible")
    assert "approved by Jane" in second.inner_text(f"#group-{group} .conflict")
    assert load_review(library, "toycar").decision(group).by == "Jane"  # type: ignore[union-attr]
    second.click("text=Reject anyway")
    saved(second, group)
    first.wait_for_selector(f"#group-{group} .decision:text('rejected by Jim')")


def test_remarks_of_two_reviewers_are_both_kept(review: Callable[..., Any], library: Workspace) -> None:
    pages = [review(name) for name in ("Jane", "Jim")]
    for page in pages:
        page.keyboard.press("j")
        page.keyboard.press("c")
        page.keyboard.type("seen")
        page.keyboard.press("Enter")
        saved(page, current(page))
    assert [one.by for one in load_review(library, "toycar").remarks(current(pages[0]))] == ["Jane", "Jim"]


def test_all_filtered_groups_are_approved_at_once(review: Callable[..., Any], library: Workspace) -> None:
    page = review("Jane", "q=gap")
    page.keyboard.press("Shift+A")
    assert page.inner_text("#ask-title") == "Approve 2 groups?"
    assert "2 new" in page.inner_text("#ask-about")
    page.keyboard.press("Enter")
    page.wait_for_selector("[data-state=approved]:text('approved 2')")
    assert len(load_review(library, "toycar").entry_by_group) == 2


def test_an_image_effect_has_images(review: Callable[..., Any]) -> None:
    page = review("Jane", "q=light")
    page.wait_for_selector(".pictures figure:nth-child(4)")
    pictures = page.locator(".pictures img")
    for picture in pictures.all():
        picture.evaluate("image => image.decode()")  # fails for an image that cannot be shown
    assert pictures.count() == 4
    captions = page.locator(".pictures figcaption").all_inner_texts()
    assert captions[0] == "before"
    assert [text.partition(":")[0] for text in captions[1:]] == [
        "after, least",
        "after, middle",
        "after, most severe",
    ]


def test_a_change_since_an_approval_is_shown_as_a_diff(
    review: Callable[..., Any], library: Workspace
) -> None:
    page = review("Jane", "q=light")
    page.keyboard.press("j")
    page.keyboard.press("a")
    group = current(page)
    saved(page, group)
    lens = library.library.parent / "tree/toycar/lens.py"
    text = lens.read_text()
    lens.write_text(text.replace("picture + self.amount", "picture + 2 * self.amount"))
    try:
        page.wait_for_selector(f"#group-{group} .state.changed")
        page.keyboard.press("a")
        page.wait_for_selector(f"#group-{group} .kept:text('reload this page')")
        page.reload()
        ready(page)
        page.keyboard.press("j")
        page.keyboard.press("d")
        page.wait_for_selector(".since .changes")
        assert "picture + self.amount" in page.inner_text(".since td.removed")
        assert "picture + 2 * self.amount" in page.inner_text(".since td.added")
    finally:
        lens.write_text(text)


def test_a_pending_approval_is_not_applied_to_later_code(
    library: Workspace, serve: Callable[..., Any], visit: Visit
) -> None:
    rmtree(library.library / "reviews", ignore_errors=True)
    lens = library.library.parent / "tree/toycar/lens.py"
    text = lens.read_text()
    with serve(library) as address:
        page = visit(address, f"{ADDRESS}#q=light")
        ready(page)
        page.fill("#by", "Jane")
        page.keyboard.press("Escape")
        intercept(page, lambda route: route.abort())
        page.keyboard.press("j")
        page.keyboard.press("a")
        page.wait_for_selector("#banner:text('1 mark waits')")
        lens.write_text(text.replace("picture + self.amount", "picture + 2 * self.amount"))
        try:
            page.unroute("**/api/review/**")
            page.reload()
            ready(page)
            page.wait_for_selector(f"#group-{current(page)} .kept:text('reload this page')")
        finally:
            lens.write_text(text)
    assert not load_review(library, "toycar").entry_by_group


def test_a_late_response_does_not_hide_a_mark(review: Callable[..., Any], library: Workspace) -> None:
    """A response from before the mark arrives after it. If the page used it, the server would refuse the next
    mark."""
    page = review("Jane")
    late: list[Any] = []

    def hold(route: Any) -> None:
        if route.request.method == "GET":
            late.append((route, route.fetch()))
        else:
            route.continue_()

    intercept(page, hold)
    while not late:
        page.wait_for_timeout(20)
    page.keyboard.press("j")
    page.keyboard.press("r")
    group = current(page)
    saved(page, group)
    for route, answer in late:
        route.fulfill(response=answer)
    page.wait_for_timeout(100)
    assert page.inner_text(f"#group-{group} .state") == "rejected"
    page.keyboard.press("f")
    page.wait_for_selector(f"#group-{group} .flagged:visible")
    saved(page, group)
    assert load_review(library, "toycar").flag(group)


@pytest.mark.slow
def test_marks_survive_a_stopped_server(library: Workspace, serve: Callable[..., Any], visit: Visit) -> None:
    rmtree(library.library / "reviews", ignore_errors=True)
    with serve(library, token="first") as address:
        page = visit(address, ADDRESS)
        ready(page)
        page.fill("#by", "Jane")
        page.keyboard.press("Escape")
        page.keyboard.press("j")
    port = int(address.partition("127.0.0.1:")[2].partition("/")[0])
    page.keyboard.press("a")
    page.wait_for_selector("#banner:visible")
    assert "1 mark waits" in page.inner_text("#banner")
    assert not load_review(library, "toycar").entry_by_group
    with serve(library, port=port, token="second") as address:
        page.wait_for_selector("#banner:text('no longer knows this page')")
        page.context.new_page().goto(address)
        page.bring_to_front()
        saved(page, current(page))
        assert not page.is_visible("#banner")
    assert len(load_review(library, "toycar").entry_by_group) == 1


@pytest.mark.slow
def test_the_review_page_is_accessible_on_any_screen(
    review: Callable[..., Any], serious_faults: Callable[[Any], list[str]]
) -> None:
    page = review("Jane")
    for key in "jajrjf":
        page.keyboard.press(key)
    page.keyboard.press("c")
    page.keyboard.type("seen")
    page.keyboard.press("Enter")
    saved(page, current(page))
    assert serious_faults(page) == []
    page.emulate_media(color_scheme="dark")
    assert serious_faults(page) == []
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") == 390
