"""A server's pages start jobs and report on them."""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.report.panels import figures_panel
from mutator.workspace import Workspace

Visit = Callable[..., Any]


@pytest.fixture(scope="module")
def folder(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    runs = tmp_path_factory.mktemp("runs")
    shutil.copytree(run, runs / "night")
    return runs


@pytest.fixture(scope="module")
def address(
    folder: Path, run: Path, serve: Callable[..., Any], module_patch: pytest.MonkeyPatch
) -> Iterator[str]:
    """The address of a server that uses the run's library."""
    module_patch.setattr(figures_panel, "draw_figures", lambda frame: ())  # they take seconds
    root = run.parent / "toy"
    with serve(Workspace(library=root / "fault_library", templates=root / "templates"), (folder,)) as found:
        yield found


@pytest.fixture(scope="module")
def module_patch() -> Iterator[pytest.MonkeyPatch]:
    """A monkeypatch that lasts as long as the server."""
    with pytest.MonkeyPatch.context() as patch:
        yield patch


def test_the_first_page_lists_runs_reviews_and_forms(
    address: str, visit: Visit, serious_faults: Callable[[Any], list[str]]
) -> None:
    page = visit(address)
    page.wait_for_selector("form.order >> nth=1")
    assert page.inner_text("#runs th a") == "night"
    assert "hazard" in page.inner_text("#runs .outcomes")
    assert page.get_attribute("#reviews a", "href") == "/review/toycar"
    assert serious_faults(page) == []
    page.emulate_media(color_scheme="dark")
    assert serious_faults(page) == []
    page.set_viewport_size({"width": 390, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") == 390


def test_a_refused_job_shows_the_servers_message(address: str, visit: Visit) -> None:
    page = visit(address)
    page.wait_for_selector("form.order >> nth=1")
    page.fill("[name=only]", "no_such == 1")
    page.click("button:text-is('Run it')")
    page.wait_for_selector("form.order .bad:text('no_such')")


def test_two_runs_are_compared_from_the_list(address: str, visit: Visit, folder: Path) -> None:
    shutil.copytree(folder / "night", folder / "later")
    (folder / "later" / "digests.json").touch()
    page = visit(address)
    assert page.locator("#runs tbody th").all_inner_texts() == ["later", "night"]  # the newest first
    options = page.locator("#compare select[name=a] optgroup[label=toy] option").all_inner_texts()
    assert options[1].startswith("night: 24 of 24, ")
    chosen = [page.input_value(f"#compare select[name={name}]") for name in "ab"]
    assert chosen == ["night", "later"]
    page.click("#compare button")
    page.wait_for_url("**/compare/night/later/")
    page.wait_for_selector("#changed[data-filtered], main")
    shutil.rmtree(folder / "later")


@pytest.mark.slow
def test_an_experiment_is_rerun_from_its_report(address: str, visit: Visit, folder: Path) -> None:
    page = visit(address, "/runs/night/report/index.html")
    page.wait_for_selector("html[data-ready]", state="attached")
    page.click("#grid tr[data-at] >> nth=0")
    page.click("section.do button:text('Exact plot')")
    page.wait_for_selector(".own-jobs .failed, .own-jobs .done", timeout=60_000)
    assert "DIFFERS" in page.inner_text(".own-jobs")  # the run's records are made up
    page.click("aside.jobs button:text('Log')")
    page.wait_for_selector("#job-log pre:text('DIFFERS')")
    page.keyboard.press("Escape")
    page.reload()
    page.wait_for_selector(".own-jobs .failed")
    assert page.locator("aside.jobs li").count() == 1
    assert list((folder / "night/plots").glob("*.svg"))
    page.wait_for_selector("section.do figure img")


@pytest.mark.slow
def test_a_campaign_is_cancelled_on_the_page_that_watches_it(
    address: str, visit: Visit, folder: Path
) -> None:
    page = visit(address)
    for name in ("first", "second"):
        page.goto(address.partition("/?")[0])
        page.select_option("[name=campaign]", "small")
        page.fill("[name=name]", name)
        page.click("button:text-is('Run it')")
        page.wait_for_url(f"**/live/{name}")
    page.wait_for_selector("#state:has-text('waits for other jobs')")
    page.click("#jobs li:has-text('second') button:text('Cancel')")
    page.wait_for_selector("#jobs li:has-text('second') .cancelled")
    page.wait_for_selector("#state:has-text('Failed')")
    assert page.locator("#jobs li:has-text('first') button:text('Cancel')").is_hidden()
    assert not (folder / "second").exists()
    page.goto(address.partition("/?")[0])
    page.wait_for_selector("#jobs li:has-text('first') .done", timeout=120_000)
    page.reload()
    page.wait_for_selector("#runs th a:text('first')")
