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
    page.fill("[name=spec]", "no/such")
    page.click("text=Try it")
    page.wait_for_selector("form.order .bad:text('no/such')")


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
def test_a_try_and_a_campaign_can_run_and_jobs_can_be_cancelled(
    address: str, visit: Visit, folder: Path
) -> None:
    page = visit(address)
    page.fill("[name=spec]", "sensor/distance")
    page.select_option("[name=variant]", "longer")
    page.select_option("[name=trigger]", "time")
    page.fill("[name=time]", "2")
    page.click("text=Try it")
    page.select_option("[name=campaign]", "small")
    for name in ("first", "second"):
        page.fill("[name=name]", name)
        page.click("button:text-is('Run it')")
        page.wait_for_selector(f"#jobs li:has-text('{name}')")
    page.click("#jobs li:has-text('second') button:text('Cancel')")
    page.wait_for_selector("#jobs li:has-text('second') .cancelled")
    page.wait_for_selector("#jobs li:has-text('first') .done", timeout=120_000)
    plot = page.locator("#jobs li:has-text('sensor/distance') a").evaluate("link => link.href")
    assert page.request.get(plot).headers["content-type"].startswith("image/svg")
    page.reload()
    page.wait_for_selector("#runs th a:text('first')")
    assert not (folder / "second").exists()
