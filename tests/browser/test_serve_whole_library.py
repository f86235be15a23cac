"""A reviewer marks twenty groups of the shipped library in the browser while the server is killed."""

import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from mutator.review.review_state_and_actions import load_review
from mutator.workspace import Workspace

ROOT = Path(__file__).parents[2]
PORT_IN = "127.0.0.1:"
KEYS = ("a", "r", "af", "rf")  # approve, reject, approve and flag, reject and flag

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("uvicorn", reason="extra `serve` is not installed")
    copy = tmp_path_factory.mktemp("whole")
    for name in ("fault_library", "templates", "target"):
        ignored = shutil.ignore_patterns("__pycache__", "reviews")
        shutil.copytree(ROOT / name, copy / name, ignore=ignored)
    (copy / "runs").mkdir()
    return copy


@contextmanager
def serving(root: Path, port: int = 0) -> Iterator[tuple[subprocess.Popen[str], str]]:
    words = ["serve", str(root / "runs"), "--root", str(root), "--no-browser", "--port", str(port)]
    process = subprocess.Popen([sys.executable, "-m", "mutator", *words], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield process, next(line.strip() for line in process.stdout if "token=" in line)
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def opened(context: Any, address: str) -> Any:
    page = context.new_page()
    page.goto(address)
    page.goto(address.partition("/?")[0] + "/review/openpilot")
    page.wait_for_selector("html[data-ready]", state="attached")
    return page


def marked(page: Any, count: int) -> dict[str, str]:
    """Mark the next groups by keys. Return group -> keys."""
    made = {}
    for at in range(count):
        page.keyboard.press("j")
        group = page.get_attribute(".group[aria-current]", "id").removeprefix("group-")
        made[group] = KEYS[at % len(KEYS)]
        for key in made[group]:
            page.keyboard.press(key)
    return made


def shown(page: Any, group: str) -> str:
    pressed = f"#group-{group} .head [data-mark][aria-pressed=true]"
    kinds = page.eval_on_selector_all(pressed, "all => all.map((button) => button.dataset.mark)")
    return "".join(kind[0] for kind in kinds)


def test_twenty_marks_survive_reloads_and_killed_servers(browser: Any, root: Path) -> None:
    context = browser.new_context(reduced_motion="reduce")
    context.set_default_timeout(90_000)
    marks: dict[str, str] = {}
    with serving(root) as (process, address):
        page = opened(context, address)
        page.fill("#by", "Jane Doe")
        page.keyboard.press("Escape")
        page.click("[data-state=new]")
        marks |= marked(page, 10)
        page.wait_for_timeout(2000)  # by then, the server has confirmed all marks
        page.reload()
        page.wait_for_selector("html[data-ready]", state="attached")
        assert {group: shown(page, group) for group in marks} == marks
        process.send_signal(signal.SIGKILL)
        process.wait()
        marks |= marked(page, 5)
        page.wait_for_selector("#banner:visible")
    with serving(root, int(address.partition(PORT_IN)[2].partition("/")[0])) as (_, again):
        with page.expect_event("load"):  # the new server does not know the page, which reloads itself
            context.new_page().goto(again)
            page.bring_to_front()
        page.wait_for_selector("html[data-ready]", state="attached")
        page.wait_for_selector("#banner", state="hidden")
        marks |= marked(page, 5)
        page.wait_for_timeout(2000)
        fresh = opened(context, again)
        assert len(marks) == 20
        assert {group: shown(fresh, group) for group in marks} == marks
    kept = load_review(Workspace(library=root / "fault_library", templates=root / "templates"), "openpilot")
    assert set(kept.entry_by_group) == set(marks)
    context.close()


def test_an_effect_on_the_road_is_shown_at_three_levels(browser: Any, root: Path) -> None:
    context = browser.new_context(reduced_motion="reduce")
    context.set_default_timeout(90_000)
    with serving(root) as (_, address):
        page = opened(context, address)
        page.fill("#find", "GaussianBlur")
        page.wait_for_selector(".group:visible .pictures figure >> nth=3")
        for picture in page.locator(".group:visible .pictures >> nth=0").locator("img").all():
            picture.evaluate("image => image.decode()")
    context.close()
