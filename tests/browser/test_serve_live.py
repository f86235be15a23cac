"""A campaign is watched from its start to its end, and a trial is varied, without reloading a page."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from mutator.report.panels import figures_panel
from mutator.workspace import Workspace

Visit = Callable[..., Any]
LONG_MS = 240_000  # for a job on a busy machine


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory, copy_toycar: Callable[[Path], Workspace]) -> Path:
    """A folder with the toy's library and a folder for runs."""
    folder = tmp_path_factory.mktemp("live")
    copy_toycar(folder)
    (folder / "runs").mkdir()
    return folder


@pytest.fixture(scope="module")
def workspace(place: Path) -> Workspace:
    return Workspace(library=place / "toy/fault_library", templates=place / "toy/templates")


@pytest.fixture(scope="module")
def address(place: Path, workspace: Workspace, serve: Callable[..., Any]) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures_panel, "draw_figures", lambda frame: ())  # they take seconds
        with serve(workspace, (place / "runs",)) as found:
            yield found


def follow(page: Any, until: str, within_s: float = LONG_MS / 1000) -> list[tuple[str, int]]:
    """The states and numbers of rows that a page shows until its state begins with `until`."""
    shown: list[tuple[str, int]] = []
    deadline = time.monotonic() + within_s
    while not (shown and shown[-1][0].startswith(until)):
        assert time.monotonic() < deadline, shown
        now = (page.inner_text("#state"), page.locator("#results tbody tr").count())
        if not shown or shown[-1] != now:
            shown.append(now)
        page.wait_for_timeout(100)
    return shown


def check_looks(page: Any, serious_faults: Callable[[Any], list[str]]) -> None:
    """Nothing serious in light and dark, and nothing wider than a phone."""
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        assert serious_faults(page) == []
    page.set_viewport_size({"width": 400, "height": 800})
    page.wait_for_timeout(500)  # plots take their new width a moment later
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    page.set_viewport_size({"width": 1440, "height": 900})


@pytest.mark.slow
def test_a_campaign_is_watched_from_its_start_to_its_report(
    address: str, visit: Visit, serious_faults: Callable[[Any], list[str]]
) -> None:
    page = visit(address)
    page.select_option("[name=campaign]", "small")
    page.fill("[name=name]", "watched")
    page.click("button:text-is('Run it')")
    page.wait_for_url("**/live/watched")
    page.evaluate("globalThis.isStillThere = true")
    shown = follow(page, "Running: experiments")
    check_looks(page, serious_faults)
    shown += follow(page, "Finished")
    assert page.evaluate("globalThis.isStillThere")
    assert shown[0][1] == 0 and shown[-1][1] > 0
    assert page.locator(".stages .over").count() == 6
    assert (
        "12 of 12" in page.inner_text("#counters") or page.inner_text("#counters dd").split(" of ")[0] != "0"
    )
    first = page.inner_text("#results tbody tr a")
    check_looks(page, serious_faults)
    page.click("#report a")
    page.wait_for_selector("html[data-ready]", state="attached")
    assert first.split(" from ")[0] in page.content()


@pytest.mark.slow
def test_a_campaign_of_a_command_line_beside_the_server_is_watched(
    address: str, visit: Visit, place: Path, workspace: Workspace
) -> None:
    """The server only sees its run folder."""
    page = visit(address)
    out = place / "runs" / "beside"
    options = ("--out", out, "-n", "1", "--library", workspace.library, "--templates", workspace.templates)
    with subprocess.Popen(
        [sys.executable, "-m", "mutator", "run", "small", *options], stdout=subprocess.DEVNULL
    ) as command:
        while not (out / "run.json").exists():
            time.sleep(0.05)
        page.goto(address.partition("/?")[0] + "/runs/beside/report/index.html")
        assert page.url.endswith("/live/beside")
        follow(page, "Finished")
    assert command.returncode == 0
    assert page.locator("#results tbody tr").count() > 0


@pytest.mark.slow
def test_a_trial_opens_in_the_experiments_view_and_its_slider_drives_it_again(
    address: str, visit: Visit, place: Path, serious_faults: Callable[[Any], list[str]]
) -> None:
    page = visit(address)
    page.wait_for_selector("form.order >> nth=1")
    page.select_option("[name=spec]", "sensor/lane")
    page.select_option("[name=scenario]", "A")
    page.select_option("[name=trigger]", "time")
    page.fill("[name=time]", "2")
    page.fill("[name=value]", "2.4")
    page.click("text=Try it")
    page.wait_for_url("**/trial/*", timeout=LONG_MS)
    page.wait_for_selector("#experiment canvas")
    first = page.get_attribute("#experiment", "data-experiment")
    assert "2.4" in page.inner_text("#experiment h2") + page.inner_text("#experiment .under")
    assert page.locator("#experiment .diff").count()
    assert page.input_value("#vary input[type=range]") == "2.4"
    check_looks(page, serious_faults)
    page.focus("#vary input[type=range]")
    for _ in range(4):  # each step begins again to wait
        page.keyboard.press("ArrowLeft")
    page.wait_for_selector(f'#experiment:not([data-experiment="{first}"])', timeout=LONG_MS)
    assert page.input_value("#vary input[type=number]") == "2.36"
    assert page.evaluate("document.activeElement.type") == "range"
    assert page.url.endswith(page.get_attribute("#experiment", "data-experiment"))
    jobs = page.evaluate("fetch('/api/jobs').then((answer) => answer.json())")["jobs"]
    assert [job["state"] for job in jobs if job["kind"] == "try"] == ["done", "done"]
    page.reload()
    page.wait_for_selector("#experiment canvas")
    assert page.input_value("#vary input[type=number]") == "2.36"


@pytest.mark.slow
def test_a_newer_value_cancels_the_older_job_and_a_wrong_one_is_refused_in_words(
    address: str, visit: Visit, place: Path
) -> None:
    page = visit(address)
    page.wait_for_selector("form.order >> nth=1")
    page.select_option("[name=spec]", "sensor/lane")
    page.select_option("[name=scenario]", "A")
    page.fill("[name=value]", "1")
    page.click("text=Try it")
    page.wait_for_url("**/trial/*", timeout=LONG_MS)
    field = page.locator("#vary input[type=number]")
    field.fill("9")
    field.press("Enter")
    page.wait_for_selector("#said.bad:has-text('expected 0 to 2.5 m')")
    field.fill("0.5")
    field.press("Enter")
    page.wait_for_selector("#jobs .running", timeout=LONG_MS)
    field.fill("0.7")
    field.press("Enter")
    page.wait_for_selector("#experiment .fault:has-text('0.7 m')", timeout=LONG_MS)
    states = page.locator("#jobs .job-state").all_inner_texts()
    assert states[:2] == ["done", "cancelled"]
